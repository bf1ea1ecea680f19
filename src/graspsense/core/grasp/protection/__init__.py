"""The protection of object and gripper while the fingers close: limits of the effort, and faults of pads and motor."""
