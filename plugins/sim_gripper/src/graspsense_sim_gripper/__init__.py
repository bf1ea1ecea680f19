"""A simulated gripper for graspsense. Importing this imports nothing else."""
