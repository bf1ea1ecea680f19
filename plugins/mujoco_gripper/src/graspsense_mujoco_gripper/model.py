"""Reading MuJoCo models: a model file is data, and nothing outside of its folder is included."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Final

import mujoco

from graspsense.plugin_api import ConfigError

OBJ: Final = mujoco.mjtObj
# MuJoCo would print each warning and write it to MUJOCO_LOG.TXT in the current folder; `instability` tells them.
mujoco.set_mju_user_warning(lambda text: None)

LARGEST_BYTES: Final = 8 * 1024 * 1024
"""Limit on the size of the text of a model."""
_INCLUDE: Final = re.compile(r"<include\b[^>]*\bfile\s*=\s*[\"']([^\"']*)[\"']")


def read_spec(path: Path) -> mujoco.MjSpec:
    """Return the model in a file, not compiled. Raises ConfigError with MuJoCo's message."""
    _check_includes(path, path.parent.resolve(), set())
    try:
        return mujoco.MjSpec.from_file(str(path))
    except (ValueError, OSError) as error:
        raise ConfigError(f"MuJoCo {mujoco.mj_versionString()} refuses {path}: {error}") from error


def gripper_spec(path: Path, timestep_s: float) -> mujoco.MjSpec:
    """Return the model of a gripper with this step, not compiled.

    Bodies that are hinged to one another do not touch, as in a gripper on a moving arm: MuJoCo leaves such contacts
    out, but not where the palm is fixed to the world.
    """
    spec = read_spec(path)
    spec.option.timestep = timestep_s
    for body in spec.bodies:
        parent = body.parent
        if parent is not None and parent.name not in ("", "world") and body.name:
            spec.add_exclude(bodyname1=parent.name, bodyname2=body.name)
    return spec


def compiled(spec: mujoco.MjSpec, called: str) -> mujoco.MjModel:
    """Return the compiled model. Raises ConfigError with MuJoCo's message."""
    try:
        return spec.compile()
    except (ValueError, OSError) as error:
        raise ConfigError(f"MuJoCo {mujoco.mj_versionString()} refuses {called}: {error}") from error


def identifier(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str, what: str) -> int:
    """Return the number of a named part of a model. Raises ConfigError with the names that it has."""
    found = int(mujoco.mj_name2id(model, kind, name))
    if found < 0:
        known = [mujoco.mj_id2name(model, kind, k) for k in range(_count(model, kind))]
        shown = ", ".join(one for one in known if one) or "none with a name"
        raise ConfigError(f"gripper.file: the model has no {what} {name!r}; there are {shown}")
    return found


def _count(model: mujoco.MjModel, kind: mujoco.mjtObj) -> int:
    counts = {
        mujoco.mjtObj.mjOBJ_BODY: model.nbody,
        mujoco.mjtObj.mjOBJ_SITE: model.nsite,
        mujoco.mjtObj.mjOBJ_GEOM: model.ngeom,
        mujoco.mjtObj.mjOBJ_JOINT: model.njnt,
        mujoco.mjtObj.mjOBJ_ACTUATOR: model.nu,
        mujoco.mjtObj.mjOBJ_SENSOR: model.nsensor,
        mujoco.mjtObj.mjOBJ_EQUALITY: model.neq,
    }
    return int(counts[kind])


def _check_includes(path: Path, folder: Path, seen: set[Path]) -> None:
    """Raise ConfigError for an include outside of the folder of the model, or a model that is too large."""
    if path in seen:
        return
    seen.add(path)
    try:
        if path.stat().st_size > LARGEST_BYTES:
            raise ConfigError(f"the model {path} has more than {LARGEST_BYTES} bytes")
        text = path.read_text(encoding="utf-8", errors="replace")
    except OSError as error:
        raise ConfigError(f"the model {path} cannot be read: {error}") from error
    for name in _INCLUDE.findall(text):
        included = (folder / name).resolve()
        if not included.is_relative_to(folder):
            raise ConfigError(
                f"the model {path} includes {name}, which is outside of its folder: copy the file into {folder}"
            )
        _check_includes(included, folder, seen)
