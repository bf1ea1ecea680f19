"""The calibration of an arm that LeRobot wrote: a JSON file with the limits of each motor."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import ConfigError, DataDamaged
from graspsense_so101_gripper.registers import STEPS

GRIPPER: Final = "gripper"
LARGEST_FILE: Final = 1 << 20


class ArmMotor(NamedTuple):
    """What such a file says of the gripper's motor."""

    id: int
    drive_mode: int
    homing_offset: int
    range_min: int
    range_max: int


def read_arm_calibration(path: Path) -> ArmMotor:
    """Return the gripper's motor of this file. Raises ConfigError if it cannot be read, DataDamaged if it is none."""
    try:
        with path.open("rb") as file:
            text = file.read(LARGEST_FILE + 1)
    except OSError as error:
        raise ConfigError(f"gripper.arm_calibration {path} cannot be read: {error.strerror}") from error
    try:
        if len(text) > LARGEST_FILE:
            raise ValueError(f"it has more than {LARGEST_FILE} bytes")
        content = json.loads(text)
        return _checked(content[GRIPPER])
    except KeyError as error:
        raise DataDamaged(
            f"{path} lacks {error}: expected the calibration of an arm that LeRobot wrote, with a motor {GRIPPER!r}"
        ) from error
    except (ValueError, TypeError, RecursionError) as error:
        raise DataDamaged(
            f"{path} is no calibration of an arm that LeRobot wrote ({error}): give its file, or calibrate the arm "
            "with lerobot-calibrate"
        ) from error


def _checked(given: Any) -> ArmMotor:
    values = [given[name] for name in ArmMotor._fields]
    for name, value in zip(ArmMotor._fields, values, strict=True):
        if type(value) is not int or not -STEPS < value < STEPS:
            raise ValueError(f"{name} is {value!r}, expected a whole number of less than {STEPS} steps")
    motor = ArmMotor(*values)
    if not 0 <= motor.range_min < motor.range_max:
        raise ValueError(f"its range is {motor.range_min} to {motor.range_max}")
    return motor
