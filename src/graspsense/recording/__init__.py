"""Recordings of grasps as MCAP files: writing them during a grasp, and reading them back."""
