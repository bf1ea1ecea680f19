"""What all grasps of a thing have in common: the model of the gripper, its test move, and the thing."""

from __future__ import annotations

import mujoco
import numpy as np
from attrs import evolve, frozen

from graspsense_mujoco_gripper.catalogue import soften_walls
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.drive import Travel, test_move
from graspsense_mujoco_gripper.gripper_file import GripperFile, read_gripper
from graspsense_mujoco_gripper.measurement import extent
from graspsense_mujoco_gripper.model import compiled, gripper_spec
from graspsense_mujoco_gripper.scene import SceneModel, read_scene
from graspsense_mujoco_gripper.variation import vary
from graspsense_mujoco_gripper.world import add_thing, put_on_arm


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
