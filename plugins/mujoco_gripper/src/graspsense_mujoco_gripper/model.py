"""Reading MuJoCo models: a model file is data, and nothing outside of its folder is included."""

from __future__ import annotations

import re
from collections.abc import Iterable
from html import unescape
from pathlib import Path
from typing import Any, Final

import mujoco
import numpy as np

from graspsense.plugin_api import ConfigError
from graspsense.simulator_api import first_bytes
from graspsense_mujoco_gripper.gripper_file import GripperFile

# MuJoCo would print each warning and write it to MUJOCO_LOG.TXT in the current folder; `instability` tells them.
mujoco.set_mju_user_warning(lambda text: None)

_OF_USERS: Final = re.compile(r"(?:numeric|tuple|key)_.*|.*_user")
"""Numbers of a model that MuJoCo does not compute with, so that any value is allowed."""
LARGEST_BYTES: Final = 8 * 1024 * 1024
"""Limit on the size of the text of a model."""
_INCLUDE: Final = re.compile(r"""<(?:include|model)\b[^>]*?\bfile\s*=\s*(?:"([^"]*)"|'([^']*)')""")


def read_spec(path: Path) -> mujoco.MjSpec:
    """Return the model in a file, not compiled. Raises ConfigError with MuJoCo's message."""
    _check_includes(path, path.parent.resolve(), set())
    try:
        spec = mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise ConfigError(f"MuJoCo {mujoco.mj_versionString()} refuses {path}: {error}") from error
    _check_assets(spec, path)
    return spec


NEEDED: Final = (
    mujoco.mjtDisableBit.mjDSBL_CONTACT
    | mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    | mujoco.mjtDisableBit.mjDSBL_SENSOR
    | mujoco.mjtDisableBit.mjDSBL_EQUALITY
    | mujoco.mjtDisableBit.mjDSBL_ACTUATION
)
"""What a model may switch off to be looked at, and a grasp needs."""
POINT: Final = "graspsense/"
"""Before the names of the sites that stand for the points of a gripper file."""


def gripper_spec(path: Path, gripper: GripperFile, timestep_s: float) -> mujoco.MjSpec:
    """Return the model of a gripper with this step, not compiled; with sites at the points of its file.

    Geoms that are named as part of a finger touch, even where the model has switched their contacts off.
    """
    spec = read_spec(path)
    spec.option.timestep = timestep_s
    spec.option.disableflags &= ~NEEDED
    if gripper.angle:
        spec.compiler.degree = gripper.angle == "degree"
    if gripper.impratio:
        spec.option.impratio, spec.option.cone = gripper.impratio, mujoco.mjtCone.mjCONE_ELLIPTIC
    exclude_neighbours(spec)
    fingers = (gripper.left, gripper.right)
    geoms = {name for finger in fingers for name in finger.geoms}
    bodies = {name for finger in fingers for name in finger.bodies}
    for geom in spec.geoms:
        if geom.name in geoms:
            geom.contype |= 1
            geom.conaffinity |= 1
        elif gripper.only_fingers and geom.parent.name not in bodies:
            geom.contype = geom.conaffinity = 0
    for side, points in (("left", gripper.gap.left), ("right", gripper.gap.right)):
        for k, point in enumerate(points):
            body = spec.body(point.body)
            if body is None:
                raise ConfigError(
                    f"gripper.file: the model has no body {point.body!r}; there are {named(spec.bodies)}"
                )
            body.add_site(name=f"{POINT}{side}{k}", pos=point.position_m, group=5)
    return spec


def exclude_neighbours(spec: mujoco.MjSpec) -> None:
    """Exclude contacts of bodies that are hinged to one another, or to a palm of several bodies.

    MuJoCo leaves such contacts out in a gripper on a moving arm, but not where the palm is fixed to the world.
    """
    groups: dict[str, list[str]] = {}
    bodies = [body for body in spec.bodies if body.parent is not None]
    for k, body in enumerate(bodies):
        body.name = body.name or f"{POINT}body{k}"
        groups.setdefault(_rigid_root(body), []).append(body.name)
    for body in bodies:
        if body.joints:
            for neighbour in groups.get(_rigid_root(body.parent), ()):
                for moving in groups[body.name]:
                    spec.add_exclude(bodyname1=neighbour, bodyname2=moving)


def _rigid_root(body: mujoco.MjsBody) -> str:
    """Return the name of the body that this one moves with: the nearest one above it that has a joint, or the world."""
    while body.parent is not None and not body.joints:
        body = body.parent
    return str(body.name)


def named(parts: Iterable[Any]) -> str:
    """Return the names of parts of a model, for a message."""
    return ", ".join(part.name for part in parts if part.name) or "none with a name"


def compiled(spec: mujoco.MjSpec, called: str) -> mujoco.MjModel:
    """Return the compiled model. Raises ConfigError with MuJoCo's message."""
    try:
        model = spec.compile()
    except (ValueError, OSError) as error:
        raise ConfigError(f"MuJoCo {mujoco.mj_versionString()} refuses {called}: {error}") from error
    # MuJoCo accepts many of them.
    bad = [
        name
        for name in dir(model)
        if isinstance(values := getattr(model, name), np.ndarray)
        and values.dtype.kind == "f"
        and not np.isfinite(values).all()
        and not _OF_USERS.fullmatch(name)
    ]
    if bad:
        raise ConfigError(f"{called} has numbers that are not finite, in {', '.join(bad)}: correct the model")
    return model


def identifier(model: mujoco.MjModel, kind: str, name: str) -> int:
    """Return the number of a named part of a model, such as a `geom`. Raises ConfigError with the names that it has."""
    try:
        return int(getattr(model, kind)(name).id)
    except KeyError as error:
        raise ConfigError(f"gripper.file: the model has no {kind} {name!r}. {error.args[0]}") from error


def _check_assets(spec: mujoco.MjSpec, path: Path) -> None:
    """Raise ConfigError for a mesh or a picture that is a pipe or a device, for which MuJoCo would wait."""
    meshes, pictures = path.parent / spec.meshdir, path.parent / spec.texturedir
    named = [meshes / asset.file for asset in (*spec.meshes, *spec.hfields, *spec.skins) if asset.file]
    for picture in spec.textures:
        named += [pictures / name for name in (picture.file, *picture.cubefiles) if name]
    for asset in named:
        if asset.exists() and not asset.is_file():
            raise ConfigError(
                f"the model {path} names {asset}, which is a pipe, a device or a folder, not a file"
            )


def _check_includes(path: Path, folder: Path, seen: set[Path]) -> None:
    """Raise ConfigError for an include outside of the folder of the model, or a model that is too large."""
    if path in seen:
        return
    seen.add(path)
    try:
        content = first_bytes(path, LARGEST_BYTES)
    except OSError as error:
        raise ConfigError(f"the model {path} cannot be read: {error.strerror}") from error
    if len(content) > LARGEST_BYTES:
        raise ConfigError(f"the model {path} has more than {LARGEST_BYTES} bytes")
    text = content.decode("utf-8", errors="replace")
    for name in (unescape("".join(quoted)) for quoted in _INCLUDE.findall(text)):
        included = (folder / name).resolve()
        if not included.is_relative_to(folder):
            raise ConfigError(
                f"the model {path} includes {name}, which is outside of its folder: copy the file into {folder}"
            )
        _check_includes(included, folder, seen)
