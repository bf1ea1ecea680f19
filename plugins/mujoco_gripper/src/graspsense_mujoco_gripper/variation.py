"""What instances and seeds draw of a thing: mass, friction, stiffness, size and place."""

from __future__ import annotations

from math import isfinite
from zlib import crc32

import mujoco
import numpy as np

from graspsense_mujoco_gripper.scene import SceneModel

MASS_SPREAD, FRICTION_SPREAD, STIFFNESS_SPREAD, SIZE_SPREAD = 0.1, 0.15, 0.1, 0.01
"""Standard deviations of the logarithms of what instances and seeds draw."""
PLACE_SPREAD_M = 0.001


def vary(model: SceneModel, generator: np.random.Generator) -> float:
    """Draw mass, friction, stiffness and size of the thing, and return its place along the gap (m).

    An instance has the same mass, stiffness and size in every trial.
    """
    own = np.random.default_rng(crc32(model.instance.encode())) if model.instance else generator
    mass, stiffness, size = np.exp(own.normal(0.0, [MASS_SPREAD, STIFFNESS_SPREAD, SIZE_SPREAD]))
    friction, place_m = np.exp(generator.normal(0.0, FRICTION_SPREAD)), generator.normal(0.0, PLACE_SPREAD_M)
    child = model.spec
    assert child is not None
    scale_friction(child, float(friction))
    _scale_size(child, float(size))
    scale_mass(child, float(mass))
    for joint in child.joints:
        joint.stiffness = joint.stiffness * stiffness
    for flex in child.flexes:
        flex.young *= stiffness
    return float(place_m)


def scale_friction(child: mujoco.MjSpec, factor: float, *, absolute: bool = False) -> None:
    """Scale the friction of all surfaces; `absolute`: give them this coefficient instead."""
    for part in (*child.geoms, *child.flexes):
        friction = np.array(part.friction)
        friction[0] = factor if absolute else friction[0] * factor
        part.friction = friction


def scale_mass(child: mujoco.MjSpec, factor: float) -> None:
    """Scale the mass of all parts, of soft ones with their inertia."""
    for geom in child.geoms:
        if isfinite(geom.mass):
            geom.mass *= factor
        else:
            geom.density *= factor
    for body in child.bodies:
        if any(flex for flex in child.flexes) and not body.geoms:
            body.mass *= factor
            body.inertia = np.array(body.inertia) * factor


def _scale_size(child: mujoco.MjSpec, factor: float) -> None:
    """Scale what is rigid; a mesh and a soft body keep their size."""
    if child.flexes or child.meshes:
        return
    for body in child.bodies:
        body.pos = np.array(body.pos) * factor
    for geom in child.geoms:
        geom.size = np.array(geom.size) * factor
        geom.pos = np.array(geom.pos) * factor
        geom.fromto = np.array(geom.fromto) * factor
