"""The equations of motion: the state of the simulated plant, its drive, and its contact with the object."""
