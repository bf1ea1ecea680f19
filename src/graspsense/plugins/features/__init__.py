"""The feature sets of graspsense."""
