"""What all grasps of a thing have in common: the model of the gripper, its test move, and the thing."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np
from attrs import define, evolve, field, frozen

from graspsense_mujoco_gripper.catalogue import soften_walls
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.drive import Travel, test_move
from graspsense_mujoco_gripper.gripper_file import GripperFile, read_gripper
from graspsense_mujoco_gripper.measurement import extent
from graspsense_mujoco_gripper.model import compiled, gripper_spec
from graspsense_mujoco_gripper.scene import SceneModel, read_scene
from graspsense_mujoco_gripper.variation import vary
from graspsense_mujoco_gripper.world import add_thing, put_on_arm

MOST_KNOWN: Final = 16


@frozen(eq=False)
class Prepared:
    """A gripper and a thing, before what a seed draws."""

    config: MujocoConfig
    gripper: GripperFile
    spec: mujoco.MjSpec
    model: mujoco.MjModel
    """The empty gripper."""
    travel: Travel
    scene: SceneModel

    def with_thing(self, generator: np.random.Generator) -> mujoco.MjModel:
        """Return the model with a thing as it is drawn, between the open fingers. Raises ConfigError."""
        if self.scene.spec is None:
            return self.model
        spec, scene = self.spec.copy(), evolve(self.scene, spec=self.scene.spec.copy())
        place, axis = self.travel.place, self.travel.axis
        if self.config.spread:
            place = place + vary(scene, generator) * axis
        add_thing(spec, scene, place, axis)
        return compiled(spec, f"the gripper with {self.config.object}")


@define(eq=False)
class Batch:
    """What the grasps of a process share: what the first one of each thing prepares."""

    known: dict[MujocoConfig, Prepared] = field(factory=dict)

    def prepared(self, config: MujocoConfig, timestep_s: float) -> Prepared:
        """Return what the grasps with these settings have in common. Raises ConfigError, UnknownName."""
        known = self.known.get(config)
        if known is None:
            if len(self.known) >= MOST_KNOWN:
                self.known.clear()
            known = self.known[config] = prepare(config, timestep_s)
        return known


def prepare(config: MujocoConfig, timestep_s: float) -> Prepared:
    """Read gripper and thing, and move the empty gripper. Raises ConfigError, UnknownName."""
    gripper, path = read_gripper(config.file)
    scene = read_scene(config.object, config.scene)
    if scene.spec is not None and gripper.left.cells:
        soften_walls(scene.spec)
    spec = gripper_spec(path, gripper, timestep_s)
    put_on_arm(spec, scene.scene)
    _integrate(spec, config.integrator, soft=scene.spec is not None and len(scene.spec.flexes) > 0)
    model = compiled(spec, str(path))
    width_m = None
    if scene.spec is not None:
        left_m, right_m = extent(compiled(scene.spec, config.object), 0)
        width_m = right_m - left_m
    return Prepared(config, gripper, spec, model, test_move(model, gripper, width_m), scene)


def _integrate(spec: mujoco.MjSpec, integrator: str, *, soft: bool) -> None:
    """Set the integrator; MuJoCo's implicit ones, which grippers name, do not integrate soft bodies."""
    if integrator == "model" and soft:
        integrator = "discrete"
    if integrator != "model":
        spec.option.integrator = getattr(mujoco.mjtIntegrator, f"mjINT_{integrator.upper()}")
