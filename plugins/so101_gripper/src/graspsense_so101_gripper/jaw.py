"""The moving jaw: from steps of its motor to the gap between the tips, and back; and which jaw a motor moves.

A motor is that of the gripper by its model, its mode, its limits, and the calibration of the arm.
"""

from __future__ import annotations

from math import asin, cos, pi, sin
from typing import Final, NamedTuple

from graspsense_so101_gripper.arm_calibration import ArmMotor
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.registers import MODEL_NUMBER, REGISTERS, STEPS

RADIANS_A_STEP: Final = 2.0 * pi / STEPS


class Jaw(NamedTuple):
    """A jaw of this length (m) from its axis to the tip: its steps where it is closed, and where it is open.

    The gap is the distance of the tips, which is 0 where the jaw is closed.
    """

    closed: int
    opened: int
    length_m: float

    @property
    def opens(self) -> int:
        """The sign of the steps in which it opens."""
        return 1 if self.opened > self.closed else -1

    @property
    def stroke_m(self) -> float:
        """The gap where it is open."""
        return self.gap_m(self.opened)

    def gap_m(self, position: int) -> float:
        """Return the gap at this position; 0 beyond the closed one."""
        angle = (position - self.closed) * self.opens * RADIANS_A_STEP
        return 2.0 * self.length_m * sin(min(max(angle, 0.0), pi) / 2.0)

    def position(self, gap_m: float) -> int:
        """Return the position nearest to this gap, between closed and open."""
        half = asin(min(max(gap_m / (2.0 * self.length_m), 0.0), 1.0))
        steps = round(2.0 * half / RADIANS_A_STEP)
        return self.closed + self.opens * min(steps, abs(self.opened - self.closed))

    def gap_rate(self, position: int, steps_per_s: float) -> float:
        """Return the rate of the gap (m/s) at this position and speed of the motor; negative closes."""
        angle = (position - self.closed) * self.opens * RADIANS_A_STEP
        return self.length_m * cos(min(max(angle, 0.0), pi) / 2.0) * steps_per_s * self.opens * RADIANS_A_STEP

    def speed(self, gap_m: float, speed_m_s: float) -> float:
        """Return the speed of the motor (steps/s) at which the gap changes with this speed."""
        along = self.gap_rate(self.position(gap_m), 1.0)
        return abs(speed_m_s / along) if along else 0.0


def opened_at(closed: int, stroke_m: float, length_m: float) -> int:
    """Return the position at which a jaw with this length that closes at `closed` has opened by `stroke_m`."""
    return Jaw(closed, closed + STEPS // 2, length_m).position(stroke_m)


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
