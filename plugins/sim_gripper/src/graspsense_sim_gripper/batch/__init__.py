"""Many grasps at once, compiled where that pays, on all cores."""

from graspsense_sim_gripper.batch.threads import run_many

__all__ = ["run_many"]
