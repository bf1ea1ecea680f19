"""The things that can be grasped: a catalogue, and files of users."""

from __future__ import annotations

import os
from collections.abc import Mapping
from functools import lru_cache
from importlib.resources import files
from math import sqrt, tanh
from pathlib import Path
from typing import Final

import mujoco
from attrs import field, frozen
from attrs.validators import ge, gt, le

from graspsense.plugin_api import UnknownName
from graspsense.simulator_api import structured, suggestion, toml_values
from graspsense_mujoco_gripper.model import read_spec

FOLDER: Final = Path(str(files("graspsense_mujoco_gripper") / "things"))
WALL_RAD_S: Final = 100.0
HALF_WALL_M: Final = 0.001
HALF_HEIGHT_M: Final = 0.03
HALF_DEPTH_M: Final = 0.02
WALL_SHARE: Final = 0.1
"""Share of the mass in each wall."""
TRAVEL_SHARE: Final = 0.4
"""Share of the width by which each wall can yield."""
STIFF, SOFT = [0.99, 0.999, 0.0001, 0.5, 2.0], [0.9, 0.95, 0.001, 0.5, 2.0]
"""MuJoCo's solimp of a contact whose own stiffness hardly counts, and its default."""
CELL_CONTACT_S: Final = 0.004
WAVE: Final = 1.8412
"""The first zero of the derivative of the Bessel function J1."""
GRAVITY_M_S2: Final = 9.81
"""MuJoCo's default (`opt.gravity`), with which the models move."""


@frozen(kw_only=True)
class Contents:
    """A liquid in an upright cylinder (SI units): `mass_kg` fills it, `fill` is the share of it that is there.

    With a free surface, a part of the liquid moves as a mass on a spring and a damper in each horizontal direction,
    and the rest is rigid. These are the figures of the first antisymmetric wave on a liquid of the mass m and the depth
    h in a cylinder of radius R (H. N. Abramson (ed.), The Dynamic Behavior of Liquids in Moving Containers, NASA
    SP-106, 1966):

        w^2 = (x g / R) tanh(x h / R),    m1 = m 2 R tanh(x h / R) / (x (x^2 - 1) h),    x = 1.841

    A cylinder that is full has no free surface: all is rigid. There are no other waves, no splashes, and no pressure on
    the walls. The moving mass is at the height of the centre of the liquid, and stops at the walls.
    """

    mass_kg: float = field(validator=gt(0.0))
    fill: float = field(validator=[gt(0.0), le(1.0)])
    radius_m: float = field(validator=gt(0.0))
    height_m: float = field(validator=gt(0.0))
    damping: float = field(default=0.03, validator=ge(0.0))
    """Damping ratio of the wave."""

    @property
    def wave_rad_s(self) -> float:
        """The natural frequency of the wave."""
        return sqrt(WAVE * GRAVITY_M_S2 / self.radius_m * self._depth)

    @property
    def wave_kg(self) -> float:
        """The mass that moves in the wave."""
        if self.fill >= 1.0:
            return 0.0
        liquid_kg, height_m = self.fill * self.mass_kg, self.fill * self.height_m
        return liquid_kg * 2.0 * self.radius_m * self._depth / (WAVE * (WAVE**2 - 1.0) * height_m)

    @property
    def _depth(self) -> float:
        return tanh(WAVE * self.fill * self.height_m / self.radius_m)

    def add_to(self, core: mujoco.MjsBody) -> None:
        """Add the liquid to the body of the container, whose middle is that of the cylinder."""
        height_m, wave_kg = self.fill * self.height_m, self.wave_kg
        place = [0.0, 0.0, 0.5 * (height_m - self.height_m)]
        cylinder = {
            "type": mujoco.mjtGeom.mjGEOM_CYLINDER,
            "size": [self.radius_m, 0.5 * height_m, 0.0],
            "contype": 0,
            "conaffinity": 0,
        }
        core.add_geom(pos=place, mass=self.fill * self.mass_kg - wave_kg, **cylinder)
        if not wave_kg:
            return
        body, rate = core.add_body(name=f"{core.name}_wave", pos=place), self.wave_rad_s
        for name, axis in (("x", [1.0, 0.0, 0.0]), ("y", [0.0, 1.0, 0.0])):
            body.add_joint(
                name=f"{core.name}_wave_{name}",
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=axis,
                range=[-self.radius_m, self.radius_m],
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                stiffness=[wave_kg * rate**2, 0.0, 0.0],
                damping=[2.0 * self.damping * wave_kg * rate, 0.0, 0.0],
            )
        body.add_geom(mass=wave_kg, **cylinder)


@frozen(kw_only=True)
class Walls:
    """Two walls on springs and dampers: what both fingers feel together (SI units).

    `armature_kg` is an inertia of each wall that has no weight, so that the steps need not be short. Not set: with it,
    a wall swings with 100 rad/s.
    """

    width_m: float
    stiffness_n_m: float
    damping_n_s_m: float
    mass_kg: float
    friction: float = 0.5
    armature_kg: float | None = None
    contents: Contents | None = None

    def spec(self, name: str) -> mujoco.MjSpec:
        """Return the model, not compiled: each wall has twice the stiffness, as both yield in series."""
        armature = self.armature_kg
        if armature is None:
            armature = 2.0 * self.stiffness_n_m / WALL_RAD_S**2
        spec = mujoco.MjSpec()
        core = spec.worldbody.add_body(name=name)
        core.add_freejoint()
        box = mujoco.mjtGeom.mjGEOM_BOX
        core_size = [self.width_m * (0.5 - TRAVEL_SHARE), 0.9 * HALF_DEPTH_M, HALF_HEIGHT_M]
        core.add_geom(
            type=box, size=core_size, mass=self.mass_kg * (1.0 - 2.0 * WALL_SHARE), contype=0, conaffinity=0
        )
        for side, sign in (("left", -1.0), ("right", 1.0)):
            wall = core.add_body(
                name=f"{name}_{side}", pos=[sign * (self.width_m / 2.0 - HALF_WALL_M), 0.0, 0.0]
            )
            wall.add_joint(
                name=f"{name}_{side}",
                type=mujoco.mjtJoint.mjJNT_SLIDE,
                axis=[-sign, 0.0, 0.0],
                range=[0.0, TRAVEL_SHARE * self.width_m],
                limited=mujoco.mjtLimited.mjLIMITED_TRUE,
                armature=armature,
                stiffness=[2.0 * self.stiffness_n_m, 0.0, 0.0],
                damping=[2.0 * self.damping_n_s_m, 0.0, 0.0],
            )
            wall.add_geom(
                name=f"{name}_{side}",
                type=box,
                size=[HALF_WALL_M, HALF_DEPTH_M, HALF_HEIGHT_M],
                mass=self.mass_kg * WALL_SHARE,
                friction=[self.friction, 0.005, 0.0001],
                condim=4,
                priority=1,
                solref=[0.001, 1.0],
                solimp=STIFF,
            )
        if self.contents is not None:
            self.contents.add_to(core)
        return spec


def soften_walls(spec: mujoco.MjSpec) -> None:
    """Give the contacts of walls the usual softness: on pads of many cells a light thing rattles with stiff ones."""
    for geom in spec.geoms:
        if list(geom.solimp) == STIFF:
            geom.solref, geom.solimp = [CELL_CONTACT_S, 1.0], SOFT


@frozen(kw_only=True)
class Thing:
    """A thing: what it is, and the force (N) at which the equalities of its shell are switched off.

    `figures` says of its figures where they are from.
    """

    summary: str = ""
    breaks_at_n: float = float("inf")
    shell: tuple[str, ...] = ()
    walls: Walls | None = None
    figures: Mapping[str, str] = field(factory=dict)


@lru_cache(maxsize=1)
def catalogue() -> Mapping[str, Thing]:
    """Return the things that come with this package, by name."""
    values = toml_values((FOLDER / "things.toml").read_text(encoding="utf-8"))
    return {name: structured(table, Thing, name) for name, table in values.items()}


def thing_named(name: str, beside: Path = Path()) -> tuple[Thing, mujoco.MjSpec | None]:
    """Return a thing and its model, not compiled; no model for `none`.

    `name` is of the catalogue, or an MJCF file (relative to `beside`). Raises UnknownName, ConfigError.
    """
    if name == "none":
        return Thing(), None
    if name.endswith(".xml"):
        path = beside / Path(os.path.expanduser(name))
        if not path.is_file():
            raise UnknownName(f"there is no file {path} (--object or gripper.object)")
        return Thing(summary=path.stem), read_spec(path)
    if name not in catalogue():
        raise UnknownName(
            f"no object named {name!r} (--object or gripper.object). Known: {', '.join(catalogue())}, none, the "
            "scenes tugged, filled, placed and shaken, an MJCF file (.xml), "
            f"or a scene file (.toml).{suggestion(name, catalogue())}"
        )
    thing = catalogue()[name]
    if thing.walls is not None:
        return thing, thing.walls.spec(name)
    return thing, read_spec(FOLDER / f"{name}.xml")
