"""The feature sets that come with graspsense."""
