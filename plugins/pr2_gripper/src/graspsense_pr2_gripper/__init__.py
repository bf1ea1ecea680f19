"""The PR2 gripper with its fingertip pressure arrays, over USB HID."""
