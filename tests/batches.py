"""Many simulated grasps, with their states, compiled or not."""

from graspsense_sim_gripper.run.batch.threads import grasps, job_of


def run_many(config, controller, scenes, seeds, *, compiled=None, **options):
    """Return a grasp of each scene with its seed, in that order, with its trace unless the options say otherwise."""
    options = {"traces": True, **options}
    return list(grasps(job_of(config, controller, options), scenes, seeds, compiled, options))
