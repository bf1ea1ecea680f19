"""Experiments from a file: sweeps over settings and seeds, on one machine or many, resumable."""
