"""The gripper of an SO-101 arm for graspsense."""
