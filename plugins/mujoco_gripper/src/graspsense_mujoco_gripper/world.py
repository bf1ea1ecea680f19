"""The world of a scene: the gripper on an arm, the thing between its fingers, and the table."""

from __future__ import annotations

from typing import Final

import mujoco
import numpy as np

from graspsense.plugin_api import ConfigError
from graspsense_mujoco_gripper.bump import add_ball
from graspsense_mujoco_gripper.measurement import extent
from graspsense_mujoco_gripper.model import compiled
from graspsense_mujoco_gripper.scene import Floats, Scene, SceneModel, unit_vector
from graspsense_mujoco_gripper.variation import scale_friction, scale_mass

PREFIX: Final = "thing/"
"""Before each name of the thing in the combined model."""
ARM: Final = "arm"
"""Before each name of an upright slide of the arm."""
SHAKE: Final = "shake"
"""Before each name of a slide along the direction of the shake."""
TABLE: Final = "table"
"""The name of the body of the table, which has no joint: it is where it is put."""
TABLE_BIT: Final = 8
"""Of `contype` and `conaffinity`: the table touches things, and not the gripper."""
TABLE_HALF_M: Final = (0.3, 0.3, 0.02)
ARM_KG: Final = 1000.0
"""Inertia of the arm: so heavy that the gripper does not move it."""
ARM_RAD_S: Final = 200.0
"""Natural frequency of the servo of the arm, critically damped."""


def put_on_arm(spec: mujoco.MjSpec, scene: Scene) -> None:
    """Put each body of the gripper that is fixed to the world on slides with a servo, if the scene moves it.

    There is an upright one for `arm`, and one along the direction of `shake`. Raises ConfigError where a body has
    joints of its own.
    """
    slides = [(ARM, np.array([0.0, 0.0, 1.0]))] if scene.arm else []
    if scene.shake is not None:
        slides.append((SHAKE, unit_vector(scene.shake.direction)))
    if not slides:
        return
    whole = compiled(spec, "the gripper")
    for body in spec.worldbody.bodies:
        if body.joints:
            raise ConfigError(
                f"gripper.object: the scene has an arm, and the body {body.name!r} of the gripper has joints of its own"
            )
        back, axis = np.zeros(4), np.zeros(3)
        mujoco.mju_negQuat(back, whole.body_quat[body.id])
        for kind, direction in slides:
            mujoco.mju_rotVecQuat(axis, direction, back)
            name = f"{kind}/{body.id}"
            body.add_joint(
                name=name,
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=axis,
                armature=ARM_KG,
                damping=[2.0 * ARM_KG * ARM_RAD_S, 0.0, 0.0],
                limited=mujoco.mjtLimited.mjLIMITED_FALSE,
            )
            servo = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
            servo.set_to_position(kp=ARM_KG * ARM_RAD_S**2)
    for body in spec.bodies:
        body.gravcomp = 1.0


def _light(spec: mujoco.MjSpec) -> None:
    """Light the scene for pictures, on white where the model has no sky of its own."""
    spec.visual.headlight.ambient = [0.4, 0.4, 0.4]
    spec.visual.headlight.diffuse = [0.6, 0.6, 0.6]
    sky = mujoco.mjtTexture.mjTEXTURE_SKYBOX
    if all(texture.type != sky for texture in spec.textures):
        white, flat = [1.0, 1.0, 1.0], mujoco.mjtBuiltin.mjBUILTIN_FLAT
        spec.add_texture(
            name=PREFIX + "sky", type=sky, builtin=flat, rgb1=white, rgb2=white, width=8, height=48
        )


def add_thing(spec: mujoco.MjSpec, model: SceneModel, place: Floats, axis: Floats) -> None:
    """Add the thing at a place, its x axis along the closing direction, and the table under it.

    Raises ConfigError with MuJoCo's message.
    """
    child, scene = model.spec, model.scene
    assert child is not None
    for body in child.bodies:
        body.gravcomp = float(not scene.table)
    _light(spec)
    if scene.needs_friction:
        # MuJoCo would else take the larger friction of thing and finger, and the mean of their stiffness.
        for part in (*child.geoms, *child.flexes):
            part.priority = max(part.priority, 1)
    if scene.friction is not None:
        scale_friction(child, scene.friction, absolute=True)
    try:
        if scene.mass_kg is not None:
            scale_mass(child, scene.mass_kg / float(np.sum(child.compile().body_mass)))
        if scene.table:
            lowest_m = _lowest(child.compile())
            _set_bits(child)
            half = TABLE_HALF_M[2]
            position = [float(place[0]), float(place[1]), float(place[2]) + lowest_m - half]
            table = spec.worldbody.add_body(name=TABLE, mocap=True, pos=position)
            table.add_geom(
                name=PREFIX + "table",
                type=mujoco.mjtGeom.mjGEOM_BOX,
                size=list(TABLE_HALF_M),
                contype=TABLE_BIT,
                conaffinity=TABLE_BIT,
                friction=[0.5, 0.005, 0.0001],
                rgba=[0.75, 0.72, 0.65, 1.0],
            )
        frame = spec.worldbody.add_frame(pos=place, quat=turned(axis))
        spec.attach(child, frame=frame, prefix=PREFIX)
        if scene.bump is not None:
            add_ball(spec, scene.bump, place, axis)
    except ValueError as error:
        raise ConfigError(f"MuJoCo refuses to attach {scene.thing} to the gripper: {error}") from error


def _set_bits(child: mujoco.MjSpec) -> None:
    """Let what touches fingers touch the table too."""
    for geom in child.geoms:
        if geom.contype & 1 or geom.conaffinity & 1:
            geom.contype |= TABLE_BIT
            geom.conaffinity |= TABLE_BIT
    for flex in child.flexes:
        flex.contype |= TABLE_BIT
        flex.conaffinity |= TABLE_BIT


def _lowest(model: mujoco.MjModel) -> float:
    """Return the height (m) of the lowest point of a thing above its origin."""
    return extent(model, 2)[0] - float(max(model.flex_radius, default=0.0))


def is_thing(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body is part of the thing."""
    return bool(model.body(body).name.startswith(PREFIX))


def turned(axis: Floats) -> Floats:
    """Return the quaternion of the smallest turn of the x axis onto this one."""
    quaternion = np.zeros(4)
    mujoco.mju_quatZ2Vec(quaternion, axis)
    # mju_quatZ2Vec turns the z axis; before it, x is turned onto z.
    x_onto_z = np.array([np.sqrt(0.5), 0.0, -np.sqrt(0.5), 0.0])
    whole = np.zeros(4)
    mujoco.mju_mulQuat(whole, quaternion, x_onto_z)
    return whole
