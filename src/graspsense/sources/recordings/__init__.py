"""Recorded grasps: of data sets, of single files, of a gripper that replays them, and as labelled trials."""
