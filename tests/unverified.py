"""A grasp before it begins, in steps that no trial grasp has verified: for tests of the plant without a controller."""

from __future__ import annotations

from types import SimpleNamespace

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.propose import grip_of, propose
from graspsense_sim_gripper.run.build import Problem, build, instantiate
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.scene.spec import ObjectSpec


def unverified_setup(config: SimConfig, scene: str | ObjectSpec, seed: int) -> GraspSetup:
    problem = build(config, scene) if isinstance(scene, str) else Problem(config, scene)
    chosen = None if problem.spec is None else propose(problem, grip_of(problem))
    return instantiate(problem, chosen, seed)


def sample(spec: ObjectSpec, seed: int | None, number: int | None = None) -> SimpleNamespace:
    """Return the instance that a seed draws, or that with this number; `seed` None: the nominal one."""
    setup = instantiate(Problem(SimConfig(spread=seed is not None), spec, number), None, seed or 0)
    return SimpleNamespace(
        width_m=setup.plant.object.width_m,
        offset_m=setup.state.contact.offset_m,
        share=setup.sensor.share,
        terms=setup.terms,
        spec=spec,
    )
