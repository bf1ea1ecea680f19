"""Grasps: the loop over ticks, plain and compiled, batches, and the backend."""
