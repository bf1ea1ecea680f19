"""A Robotiq 2F-85 gripper for graspsense."""
