"""Composing the equations of a scene, and compiling them with numba."""
