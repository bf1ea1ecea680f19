"""Grippers that have a MuJoCo model. Importing this imports nothing else."""
