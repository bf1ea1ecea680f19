"""Transports: one interface, and one file for each way to reach a board."""
