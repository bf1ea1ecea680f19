"""Simulating many grasps on all cores, compiled if that saves time."""

from graspsense_sim_gripper.run.batch.threads import run_many

__all__ = ["run_many"]
