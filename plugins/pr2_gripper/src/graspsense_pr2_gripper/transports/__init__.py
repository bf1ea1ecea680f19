"""The ways to a board: one thin interface, a file for each wire."""
