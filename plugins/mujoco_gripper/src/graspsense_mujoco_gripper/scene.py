"""A scene: a thing between the fingers, or on a table, an arm that lifts the gripper, and a cord that pulls.

thing = "can"
table = true
arm = [[0.3, 0.0], [0.8, 0.05]]              # seconds after both fingers touch, height of the gripper (m)

[cord]
direction = [0.0, 0.0, -1.0]
force = [[0.8, 0.0], [1.8, 5.0]]             # seconds after both fingers touch, force (N)

[shake]
amplitude_m = 0.008
frequency_hz = 3.0
start_s = 2.0                                # seconds after both fingers touch
cycles = 3.0
"""

from __future__ import annotations

import os
from importlib.resources import files
from itertools import pairwise
from math import cos, isfinite, pi, sin
from pathlib import Path
from typing import Final

import mujoco
import numpy as np
from attrs import evolve, field, frozen
from attrs.validators import ge, gt, le, optional
from numpy.typing import NDArray

from graspsense.plugin_api import ConfigError
from graspsense_mujoco_gripper.bump import ABOVE_ZERO, Bump
from graspsense_mujoco_gripper.catalogue import Thing, Walls, thing_named
from graspsense_mujoco_gripper.gripper_file import FROM_ZERO, described

Floats = NDArray[np.float64]
SCENES: Final = Path(str(files("graspsense_mujoco_gripper") / "scenes"))
SHIPPED_SCENES: Final = ("tugged", "filled", "placed", "shaken")
"""The scene files of this package."""
Schedule = tuple[tuple[float, ...], ...]


@frozen(kw_only=True)
class Cord:
    """A cord on the thing: where it pulls (a vector of the world), its force (N) over the time (s) since contact."""

    direction: tuple[float, ...] = (0.0, 0.0, -1.0)
    force: Schedule

    def __attrs_post_init__(self) -> None:
        _check_schedule("force", self.force)
        unit_vector(self.direction)

    def pull_n(self, t_s: float) -> Floats:
        """Return the force (N, in the world) at a time."""
        return value_at(self.force, t_s) * unit_vector(self.direction)


@frozen(kw_only=True)
class Shake:
    """A shake of the gripper: a sine along a direction of the world, which grows and fades within a period each.

    With n = (t - start_s) frequency_hz periods done, and m = min(n, cycles - n, 1), the gripper is displaced by
    amplitude_m (1 - cos(pi m)) / 2 sin(2 pi n). Times are since both fingers touched.
    """

    amplitude_m: float = field(validator=[gt(0.0), le(0.1)])
    frequency_hz: float = field(validator=[gt(0.0), le(20.0)])
    start_s: float = field(validator=[ge(0.0), le(600.0)])
    cycles: float = field(default=3.0, validator=[ge(2.0), le(1000.0)])
    direction: tuple[float, ...] = (1.0, 0.0, 0.0)

    def __attrs_post_init__(self) -> None:
        unit_vector(self.direction)

    @property
    def end_s(self) -> float:
        """When it ends."""
        return self.start_s + self.cycles / self.frequency_hz

    def place_m(self, t_s: float) -> float:
        """Return the displacement at a time."""
        periods = (t_s - self.start_s) * self.frequency_hz
        share = min(max(min(periods, self.cycles - periods), 0.0), 1.0)
        return self.amplitude_m * 0.5 * (1.0 - cos(pi * share)) * sin(2.0 * pi * periods)


@frozen(kw_only=True)
class Scene:
    """What the gripper grasps, and what happens to it. Without a table the thing has no weight.

    `arm` is the height (m) of the gripper over the time (s) since both fingers touched, `table_height` that of the
    table, which may rise while the thing is in the air, and `fill` the mass (kg) that was filled in by then. `shake`
    moves the gripper to and fro, and `bump` is a ball that comes from the side. `mass_kg` and `friction` replace those
    of the thing. `roughness_m` is the rms height of its surface, which cells on springs feel.
    """

    thing: str
    walls: Walls | None = None
    table: bool = False
    table_height: Schedule = ()
    arm: Schedule = ()
    fill: Schedule = ()
    cord: Cord | None = None
    shake: Shake | None = None
    bump: Bump | None = None
    mass_kg: float | None = field(default=None, validator=optional(ABOVE_ZERO))
    friction: float | None = field(default=None, validator=optional(FROM_ZERO))
    roughness_m: float = field(default=0.0, validator=[ge(0.0), le(1e-3)])

    def __attrs_post_init__(self) -> None:
        for name in ("arm", "table_height", "fill"):
            if getattr(self, name):
                _check_schedule(name, getattr(self, name))
        if self.table_height and not self.table:
            raise ValueError("table_height moves a table: add table = true")
        if any(mass_kg < 0.0 for _, mass_kg in self.fill):
            raise ValueError("fill is a mass (kg), at least 0")

    @property
    def is_disturbed(self) -> bool:
        """Whether something moves the thing or pulls at it, or fills it."""
        return bool(self.arm or self.fill or self.cord or self.shake or self.bump)

    @property
    def needs_friction(self) -> bool:
        """Whether the friction of the thing decides what happens."""
        return self.table or self.is_disturbed or self.friction is not None


@frozen(eq=False)
class SceneModel:
    """A scene that is read: its thing and the thing's model, not compiled; no model where there is no thing."""

    scene: Scene
    thing: Thing
    spec: mujoco.MjSpec | None
    instance: str


def scene_named(name: str, around: str = "") -> Scene:
    """Return the scene of a name: a scene file, or a thing alone; with `around`, that scene with this thing in it.

    Raises ConfigError.
    """
    path = SCENES / f"{name}.toml" if name in SHIPPED_SCENES else Path(os.path.expanduser(name))
    is_scene = path.suffix == ".toml"
    if not around:
        return described(path, "MuJoCo scene", Scene) if is_scene else Scene(thing=name)
    if is_scene:
        raise ConfigError(
            f"gripper.object names the scene {name}, and gripper.scene the scene {around}: name a thing as the object"
        )
    scene = scene_named(around)
    if scene.thing == around:
        raise ConfigError(
            f"gripper.scene: there is no scene {around!r}. Known: {', '.join(SHIPPED_SCENES)}, or a scene file (.toml)"
        )
    return evolve(scene, thing=name, walls=None)


def read_scene(name: str, around: str = "") -> SceneModel:
    """Return the scene of this name: a thing of the catalogue, an MJCF file, or a scene file (TOML).

    What follows `#` names an instance, which is the same in all states of a thing (`flask_full:open#3`). With
    `around`, the thing is in that scene. Raises UnknownName, ConfigError.
    """
    name, number, instance = name.partition("#")
    scene = scene_named(name, around)
    beside = Path(os.path.expanduser(name)).parent if name.endswith(".toml") else Path()
    if scene.walls is not None:
        thing, spec = Thing(walls=scene.walls), scene.walls.spec(scene.thing)
    else:
        thing, known = thing_named(scene.thing, beside)
        if known is None:
            return SceneModel(scene, thing, None, "")
        spec = known
    return SceneModel(scene, thing, spec, f"{name.partition(':')[0]}#{instance}" if number else "")


def _check_schedule(name: str, rows: Schedule) -> None:
    if not rows or any(len(row) != 2 or not all(map(isfinite, row)) for row in rows):
        raise ValueError(
            f"{name} is a list of pairs of a time (s) and a value, as in [[0.3, 0.0], [0.8, 0.05]]"
        )
    times = [row[0] for row in rows]
    if any(later_s <= earlier_s for earlier_s, later_s in pairwise(times)):
        raise ValueError(f"the times of {name} rise from pair to pair")


def unit_vector(direction: tuple[float, ...]) -> Floats:
    """Return a direction with the length 1. Raises ValueError."""
    if len(direction) != 3 or not 0.0 < float(np.linalg.norm(direction)) < float("inf"):
        raise ValueError("direction is a vector of three numbers, not all zero")
    unit: Floats = np.asarray(direction) / np.linalg.norm(direction)
    return unit


def value_at(rows: Schedule, t_s: float) -> float:
    """Return the value at a time: straight between the pairs, the nearest one before and after them."""
    times, values = zip(*rows, strict=True)
    return float(np.interp(t_s, times, values))
