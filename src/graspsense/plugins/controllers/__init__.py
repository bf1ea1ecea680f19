"""The control laws of the default pipeline: velocity, force, and the hybrid of the two."""
