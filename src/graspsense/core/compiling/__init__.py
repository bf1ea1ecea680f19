"""Compiling a function with all it calls."""
