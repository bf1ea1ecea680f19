"""Identifying the scene of an object from recorded squeezes: terms, parameters, intervals, and what stays open."""
