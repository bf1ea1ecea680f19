"""LeRobot data sets: read as trials, and written from trials."""
