"""Where trials come from besides a gripper: the iCub data set, CSV files, ROS bags, simulation, stored trials."""
