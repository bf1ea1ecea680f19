"""Whether a motor is that of the gripper: its model, its mode, its limits, and the calibration of the arm."""

from __future__ import annotations

from graspsense_so101_gripper.arm_calibration import ArmMotor
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.jaw import Jaw
from graspsense_so101_gripper.registers import MODEL_NUMBER, REGISTERS, STEPS


class Unfit(Exception):
    """The motor is not what the settings say; the text describes it."""


def jaw_of(memory: bytes, config: So101Config, arm: ArmMotor | None) -> Jaw:
    """Return the jaw of the motor with this memory, by the calibration of the arm if there is one. Raises Unfit."""
    number = {name: register.number(memory) for name, register in REGISTERS.items() if register.address < 34}
    if number["model_number"] != MODEL_NUMBER:
        raise Unfit(f"it is a motor of model {number['model_number']}, and an STS3215 is {MODEL_NUMBER}")
    if number["operating_mode"] != 0:
        raise Unfit(f"its operating mode is {number['operating_mode']}, and this needs 0, positions")
    limits = number["min_position_limit"], number["max_position_limit"]
    if arm is None:
        if limits[1] - limits[0] >= STEPS - 1:
            raise Unfit(
                "its limits are those of the factory, so the closed position is not known: calibrate the arm with "
                "lerobot-calibrate"
            )
        return Jaw(*limits, config.jaw_length_m)
    expected = (arm.id, arm.homing_offset, arm.range_min, arm.range_max)
    if expected != (config.motor, number["homing_offset"], *limits):
        raise Unfit(
            f"gripper.arm_calibration is that of another arm, or older than the motor: it has id {arm.id}, offset "
            f"{arm.homing_offset}, {arm.range_min} to {arm.range_max}; the motor has id {config.motor}, offset "
            f"{number['homing_offset']}, {limits[0]} to {limits[1]}. Calibrate the arm with lerobot-calibrate"
        )
    ends = (arm.range_max, arm.range_min) if arm.drive_mode else (arm.range_min, arm.range_max)
    return Jaw(*ends, config.jaw_length_m)
