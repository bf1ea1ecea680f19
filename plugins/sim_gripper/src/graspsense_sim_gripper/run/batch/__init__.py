"""Simulating many grasps on all cores, compiled if that saves time."""
