"""The gripper file: which parts of a MuJoCo model close the fingers, and what is measured.

model = "package:robosuite:models/assets/grippers/panda_gripper.xml"
actuators = ["gripper_finger_joint1", "gripper_finger_joint2"]
open = [0.04, -0.04]
closed = [0.0, 0.0]

[gap]
geoms = ["finger1_pad_collision", "finger2_pad_collision"]

[left]
geoms = ["finger1_pad_collision", "finger1_collision"]

[right]
geoms = ["finger2_pad_collision", "finger2_collision"]
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from importlib.resources import files
from math import inf
from pathlib import Path
from typing import Any, Final, Literal, TypeVar

from attrs import field, frozen
from attrs.validators import ge, gt, lt, min_len

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import ValidationFailed, read_toml, structured

SHIPPED: Final = ("parallel", "soft_pads")
"""The gripper files of this package."""

FROM_ZERO: Final = (ge(0.0), lt(inf))
DescribedT = TypeVar("DescribedT")


@frozen(kw_only=True)
class Point:
    """A point on a body, in the frame of the body (m)."""

    body: str
    position_m: tuple[float, float, float] = field(alias="at")


@frozen(kw_only=True)
class Gap:
    """How the gap is measured: by two sites, points on the fingers, two geoms, or a joint; exactly one of them.

    That of sites, and of the means of `left` and `right` points, is their distance along the closing direction; that of
    geoms is the distance of their surfaces; that of a joint is `offset_m` plus `scale` times its position.
    """

    sites: tuple[str, str] | None = None
    left: tuple[Point, ...] = ()
    right: tuple[Point, ...] = ()
    geoms: tuple[str, str] | None = None
    joint: str = ""
    scale: float = 1.0
    offset_m: float = 0.0

    def __attrs_post_init__(self) -> None:
        if bool(self.left) != bool(self.right):
            raise ValueError("the points of the gap are given for both fingers: left and right")
        if bool(self.sites) + bool(self.left) + bool(self.geoms) + bool(self.joint) != 1:
            raise ValueError("give the gap by one of sites, geoms and joint, or by left and right points")


@frozen(kw_only=True)
class Finger:
    """A finger: what touches things, named by geoms or by the bodies that have them, and where its force comes from.

    Without `sensor` the force is the sum of the contact forces on these geoms along the closing direction; with it, the
    value of a touch sensor, or of a force sensor along that direction. `array` names a tactile sensor with `rows` times
    `columns` cells (the plugin `mujoco.sensor.touch_grid`). `cells` names instead the joints of as many cells, row by
    row, each a slide on a spring: the force of a cell is that of its spring, the force on the finger their sum. `edge`
    names a touch sensor of the sides of the finger.
    """

    geoms: tuple[str, ...] = ()
    bodies: tuple[str, ...] = ()
    sensor: str = ""
    array: str = ""
    cells: tuple[str, ...] = ()
    rows: int = 0
    columns: int = 0
    edge: str = ""

    def __attrs_post_init__(self) -> None:
        if not self.geoms and not self.bodies:
            raise ValueError("name the geoms of the finger that touch things, or the bodies that have them")
        if bool(self.array or self.cells) != (self.rows > 0 and self.columns > 0):
            raise ValueError("an array has rows and columns: give array or cells, rows and columns together")
        if self.cells and (self.array or self.sensor or len(self.cells) != self.rows * self.columns):
            raise ValueError(
                f"cells has {len(self.cells)} names for {self.rows} rows and {self.columns} columns: give a joint for "
                "each cell, and neither array nor sensor"
            )


@frozen(kw_only=True)
class ModelSensor:
    """A further channel: a sensor of the model, with the unit of its values."""

    sensor: str
    unit: str


@frozen(kw_only=True)
class PalmSensor:
    """The accelerometer of the palm, read in each step of MuJoCo, as the channel `acceleration`.

    Its noise on each axis is `floor_m_s2` at rest, and grows by `gear_1_s` times the rate of the gap (m/s).
    """

    sensor: str
    floor_m_s2: float = field(default=0.0, validator=FROM_ZERO)
    gear_1_s: float = field(default=0.0, validator=FROM_ZERO)


@frozen(kw_only=True)
class GripperFile:
    """A gripper: its model, the actuators that close it, and its measurements.

    `open` and `closed` are the controls of each actuator with the fingers open and closed. `closing` is the direction
    in which the left finger moves (a vector of the world), by default from the left finger to the right one. `angle` is
    the unit of angles in a model that leaves it to those that include it. With `only_fingers`, only their geoms touch:
    the hull of a mesh may fill the space between them. `impratio` is MuJoCo's option of that name, with elliptic
    friction cones; 0: as the model says. At 1, MuJoCo's default, things creep out of fingers that are not parallel.
    """

    model: str
    actuators: tuple[str, ...] = field(validator=min_len(1))
    open: tuple[float, ...]
    closed: tuple[float, ...]
    gap: Gap
    left: Finger
    right: Finger
    closing: tuple[float, float, float] | None = None
    angle: Literal["", "radian", "degree"] = ""
    only_fingers: bool = False
    impratio: float = field(default=0.0, validator=FROM_ZERO)
    effort_limit_n: float = field(default=0.0, validator=ge(0.0))
    speed_limit_m_s: float = field(default=0.1, validator=gt(0.0))
    channels: Mapping[str, ModelSensor] = field(factory=dict)
    accelerometer: PalmSensor | None = None

    def __attrs_post_init__(self) -> None:
        for name, values in (("open", self.open), ("closed", self.closed)):
            if len(values) != len(self.actuators):
                raise ValueError(f"{name} has {len(values)} values for {len(self.actuators)} actuators")
        shared = {*self.left.geoms, *self.left.bodies} & {*self.right.geoms, *self.right.bodies}
        if shared:
            raise ValueError(
                f"{', '.join(sorted(shared))} is part of both fingers: a gripper has two opposed ones"
            )
        if self.left.rows * self.left.columns != self.right.rows * self.right.columns:
            raise ValueError("the arrays of both fingers have the same number of cells")
        for name in ("cells", "edge"):
            if bool(getattr(self.left, name)) != bool(getattr(self.right, name)):
                raise ValueError(f"both fingers have {name}, or neither")
        if self.accelerometer is not None and "acceleration" in self.channels:
            raise ValueError(
                "acceleration is the channel of the accelerometer: give another name in channels"
            )


def read_gripper(name: str) -> tuple[GripperFile, Path]:
    """Return a gripper file and the path of its model. Raises ConfigError with what was found and what to do.

    A name of `SHIPPED` is a gripper of this package, and an empty name its parallel gripper.
    """
    path = Path(os.path.expanduser(name))
    if not name or name in SHIPPED:
        path = Path(str(files("graspsense_mujoco_gripper") / f"{name or 'parallel'}.toml"))
    gripper = described(path, "gripper", GripperFile)
    return gripper, model_path(gripper.model, path.parent)


def described(path: Path, what: str, cls: type[DescribedT]) -> DescribedT:
    """Return what a TOML file describes. Raises ConfigError."""
    layer = read_toml(path, str(path), what)
    try:
        return structured(layer.values, cls, f"a {what} file")
    except ValidationFailed as misfit:
        raise ConfigError("\n".join(layer.complain(problem) for problem in misfit.problems)) from None


def model_path(name: str, folder: Path) -> Path:
    """Return the path of a model: in the folder, `package:PACKAGE:PATH`, or `menagerie:ROBOT[/ENTRY]`.

    Raises ConfigError.
    """
    if name.startswith("menagerie:"):
        return _menagerie_path(*name.removeprefix("menagerie:").partition("/")[::2])
    if not name.startswith("package:"):
        path = folder / Path(os.path.expanduser(name))
        if not path.is_file():
            raise ConfigError(f"there is no file {path}: name a MuJoCo model (.xml), or package:NAME:PATH")
        return path
    package, _, resource = name.removeprefix("package:").partition(":")
    installed = _package_folder(package)
    if installed is None:
        raise ConfigError(
            f"gripper.file: the model {name} is part of the package {package}, which is not installed: "
            f"pip install {package}"
        )
    path = installed / resource
    if ".." in Path(resource).parts or not path.is_file():
        raise ConfigError(f"gripper.file: the package {package} has no file {resource}")
    return path


def _menagerie_path(robot: str, entry: str) -> Path:
    """Return the path of a model of MuJoCo Menagerie, whose package downloads it at first use. Raises ConfigError."""
    try:
        menagerie: Any = import_module("mujoco_menagerie")
    except ImportError as error:
        raise ConfigError(
            f"gripper.file: the model menagerie:{robot} needs the package mujoco-menagerie ({error}): "
            "pip install mujoco-menagerie"
        ) from error
    try:
        repository = menagerie.get(robot)
        return Path(repository.xml(entry or repository.default_model))
    except LookupError as error:
        raise ConfigError(f"gripper.file: MuJoCo Menagerie has no menagerie:{robot}: {error}") from error
    except (menagerie.MenagerieError, OSError, ValueError) as error:
        raise ConfigError(
            f"gripper.file: the model menagerie:{robot} cannot be downloaded: {error}. Connect to the network, or copy "
            "the model here and set MENAGERIE_ROOT to a checkout of MuJoCo Menagerie"
        ) from error


def _package_folder(package: str) -> Path | None:
    """Return the folder of an installed package, without importing it."""
    from importlib.util import find_spec

    if not package.isidentifier():
        raise ConfigError(f"gripper.file: {package!r} is not the name of a package: package:NAME:PATH")
    spec = find_spec(package)
    if spec is None or not spec.submodule_search_locations:
        return None
    return Path(next(iter(spec.submodule_search_locations)))
