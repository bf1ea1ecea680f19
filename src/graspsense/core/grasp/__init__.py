"""One grasp with a gripper: the runner, the protection of gripper and object, and calibration."""
