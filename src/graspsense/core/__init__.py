"""What a grasp is. Knows no gripper, no object, no file format and no terminal."""
