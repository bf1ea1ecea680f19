"""Calibration files: a folder for each serial number, and in it a file for each kind, with its version and hash.

    FOLDER/SERIAL/tare.json, gain.json, load-cell.json, friction.json, delivered-force.json

A file names the device that it was made on; its use with another device is an error.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping
from datetime import datetime
from itertools import pairwise
from pathlib import Path
from typing import Any, Final

from attrs import asdict, fields_dict, frozen
from attrs.filters import exclude

from graspsense.core.components.caller import set_option
from graspsense.core.files.user_folders import NOWHERE, data_folder, make_closed, why_open
from graspsense.core.files.whole_file import first_bytes, write_whole
from graspsense.core.grasp.calibration import Cells, LoadTable, MotorTable
from graspsense.core.values.errors import ConfigError, DataDamaged

FORMAT: Final = "graspsense-calibration"
VERSION: Final = 1
KINDS: Final = ("tare", "gain", "load-cell", "friction", "delivered-force")
DIRECTIONS: Final = ("closing", "opening")
"""In which a motor pushes."""
UNCALIBRATED: Final = "none"
"""The value of the setting for the use without calibration."""
CALIBRATION_BYTES: Final = 2**20
"""Of a longer file, only so many are read, which are then no JSON."""


@frozen(kw_only=True)
class Calibration:
    """One calibration of one device.

    `device` holds what the numbers depend on besides the serial number: transmission, counts per newton. `made` is the
    time in ISO 8601 with the zone. `sha256` is the hash of the content, empty before it is written.
    """

    kind: str
    serial: str
    device: Mapping[str, Any]
    made: str
    data: Mapping[str, Any]
    sha256: str = ""


def calibration_path(folder: str | Path, serial: str, kind: str) -> Path:
    """Return the path of a calibration of this kind and serial number; an empty folder means that of the user.

    Raises ConfigError for a serial number that cannot name a folder, and for a user without a home folder.
    """
    if not re.fullmatch(r"[\w.+-]+", serial) or serial.startswith("."):
        raise ConfigError(
            f"calibrations are kept by serial number, and {serial!r} is not one: it has letters, digits and . + - _"
        )
    kept = calibration_folder(folder)
    if kept is None:
        raise ConfigError(f"{NOWHERE.format('XDG_DATA_HOME')}, or name one by gripper.calibration")
    return kept / serial / f"{kind}.json"


def calibration_folder(given: str | Path) -> Path | None:
    """Return the folder that this setting names: an empty one that of the user, None if that has no home folder."""
    if given:
        return Path(os.path.expanduser(given))
    data = data_folder()
    return None if data is None else data / "calibration"


def write_calibration(path: Path, calibration: Calibration) -> Calibration:
    """Write the file atomically, and return the calibration with its hash. Raises OSError."""
    content = {"format": FORMAT, "version": VERSION, **asdict(calibration, filter=exclude("sha256"))}
    make_closed(path.parent)
    write_whole(path, json.dumps({**content, "sha256": _hash(content)}, indent=1).encode(), mode=0o644)
    return read_calibration(path)


def read_calibration(path: Path) -> Calibration:
    """Return the calibration in this file.

    Raises ConfigError if the machine cannot read it, DataDamaged if it is not a calibration of graspsense, was changed
    since it was written, or has invalid numbers; FileNotFoundError if it is missing.
    """
    try:
        content = json.loads(first_bytes(path, CALIBRATION_BYTES))
    except FileNotFoundError:
        raise
    except OSError as error:
        raise ConfigError(
            f"calibration {path} cannot be read: {error.strerror or error}. Its content may be whole: check the disk "
            "and the permissions of the file"
        ) from error
    except (ValueError, RecursionError) as error:
        raise DataDamaged(f"{path} cannot be read as a calibration: {error}") from error
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise DataDamaged(f"{path} is not a calibration of graspsense: its format is not {FORMAT!r}")
    if content.get("version") != VERSION:
        raise DataDamaged(
            f"{path} has version {content.get('version')!r}, and this graspsense reads version {VERSION}"
        )
    sha256 = content.pop("sha256", None)
    if sha256 != _hash(content):
        raise DataDamaged(
            f"{path} was changed after it was written (its hash does not fit): calibrate again, or put back the "
            "file as it was"
        )
    try:
        stored = {**content, "sha256": sha256}
        calibration = Calibration(**{name: stored[name] for name in fields_dict(Calibration)})
        datetime.fromisoformat(calibration.made)
        _READERS[calibration.kind](calibration)
    except (KeyError, TypeError, ValueError) as error:
        raise DataDamaged(f"{path}: {type(error).__name__}: {error}. Calibrate again") from error
    return calibration


def calibrations_of(folder: str | Path, serial: str, device: Mapping[str, Any]) -> dict[str, Calibration]:
    """Return the calibrations of this device by kind; empty if `folder` is `none`.

    Raises ConfigError if `folder` names a folder that does not exist, if another user could have changed a file, or if
    a file was made on another device, or on this one with other numbers; it names the choices. Raises DataDamaged.
    """
    place = None if folder == UNCALIBRATED else calibration_folder(folder)
    if place is None:
        return {}
    if folder and not place.is_dir():
        raise ConfigError(
            f"gripper.calibration is {str(folder)!r}, and there is no such folder. There are three choices:\n"
            "  correct its name\n"
            "  calibrate this device into it:  graspsense calibrate tare\n"
            f"  run without:                    {set_option('gripper.calibration=none')}"
        )
    calibrations: dict[str, Calibration] = {}
    for kind in KINDS:
        path = calibration_path(folder, serial, kind)
        _refuse_open(path)
        try:
            calibration = read_calibration(path)
        except FileNotFoundError:
            continue
        misfits = [
            f"{name} was {calibration.device.get(name)!r} and is {value!r}"
            for name, value in device.items()
            if calibration.device.get(name) != value
        ]
        if calibration.serial != serial:
            misfits.insert(0, f"serial was {calibration.serial!r} and is {serial!r}")
        if calibration.kind != kind:
            misfits.insert(0, f"kind is {calibration.kind!r}")
        if misfits:
            raise ConfigError(
                f"{path} does not fit this device: {'; '.join(misfits)}. There are two choices:\n"
                f"  calibrate this device:  graspsense calibrate {kind} --replace\n"
                f"  run without:            {set_option('gripper.calibration=none')}"
            )
        calibrations[kind] = calibration
    return calibrations


def _refuse_open(path: Path) -> None:
    """Raise ConfigError if another user could have changed this calibration, and with it what the gripper measures."""
    reason = why_open(path) if path.exists() else ""
    if reason:
        raise ConfigError(
            f"the calibration {path} is not used, because another user could have changed it: {reason}. "
            "There are two choices:\n"
            f"  use a copy:             copy it to a folder of yours, named by "
            f"{set_option('gripper.calibration=FOLDER')}\n"
            f"  run without:            {set_option('gripper.calibration=none')}"
        )


def stored_zero(calibration: Calibration) -> tuple[Cells, Cells]:
    """Return the zeros of both fingertips from a stored tare."""
    left, right = _numbers(calibration.data["left"]), _numbers(calibration.data["right"])
    if len(left) != len(right) or not left:
        raise ValueError(
            f"the tare has {len(left)} cells of the left fingertip and {len(right)} of the right"
        )
    return left, right


def stored_gain(calibration: Calibration) -> tuple[Cells, Cells]:
    """Return the counts under one newton of each cell of the left and of the right fingertip."""
    left, right = _numbers(calibration.data["left"]), _numbers(calibration.data["right"])
    if not left or not right or min(*left, *right) <= 0.0:
        raise ValueError("the gain of each cell must be a number above 0")
    return left, right


def stored_tables(calibration: Calibration) -> tuple[LoadTable, LoadTable]:
    """Return the stored load tables of the left and of the right pad."""
    left, right = (_table(calibration.data[side], "pad_n", "load_n") for side in ("left", "right"))
    return left, right


def stored_motor_tables(calibration: Calibration) -> tuple[MotorTable, MotorTable]:
    """Return the stored tables of a motor that pushes to close and of one that pushes to open."""
    errors = _numbers([calibration.data[direction]["error_n"] for direction in DIRECTIONS])
    if min(errors) < 0.0:
        raise ValueError("the error of a table is negative")
    closing, opening = (
        MotorTable(_table(calibration.data[direction], "motor", "load_n"), error_n)
        for direction, error_n in zip(DIRECTIONS, errors, strict=True)
    )
    return closing, opening


def _load_cell(calibration: Calibration) -> object:
    """Return the stored tables, whichever they are: of two pads, or of the two directions of a motor."""
    pads = "left" in calibration.data
    return stored_tables(calibration) if pads else stored_motor_tables(calibration)


def stored_delivered_force(calibration: Calibration) -> LoadTable:
    """Return the stored table from the force asked for (N) to the force that the gripper delivered (N)."""
    return _table(calibration.data, "asked_n", "delivered_n")


def stored_friction(calibration: Calibration) -> tuple[Cells, Cells, Cells]:
    """Return the gaps (m) of a stored friction table, and the breakaway efforts (N), closing and opening."""
    columns = [_numbers(calibration.data[name]) for name in ("gap_m", "closing_n", "opening_n")]
    if len({len(column) for column in columns}) != 1:
        raise ValueError("the friction table's columns differ in length")
    return columns[0], columns[1], columns[2]


_READERS: Final = {
    "tare": stored_zero,
    "gain": stored_gain,
    "load-cell": _load_cell,
    "friction": stored_friction,
    "delivered-force": stored_delivered_force,
}


def _table(data: Mapping[str, Any], given: str, measured: str) -> LoadTable:
    forces, loads = _numbers(data[given]), _numbers(data[measured])
    if len(forces) != len(loads) or len(forces) < 2:
        raise ValueError(f"the table has {len(forces)} and {len(loads)} forces")
    if any(a >= b for a, b in pairwise(forces)) or list(loads) != sorted(loads):
        raise ValueError("the table does not rise")
    return LoadTable(forces, loads)


def _numbers(values: Any) -> Cells:
    if not isinstance(values, list) or not all(
        isinstance(v, int | float) and not isinstance(v, bool) and -1e9 < v < 1e9 for v in values
    ):
        raise ValueError("expected a list of numbers")
    return tuple(float(value) for value in values)


def _hash(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True, separators=(",", ":")).encode()).hexdigest()
