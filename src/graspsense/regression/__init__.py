"""Predicting a number of a grasp (a force at break, a ripeness, a fill level) from its features."""
