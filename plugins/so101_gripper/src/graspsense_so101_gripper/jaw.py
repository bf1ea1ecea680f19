"""The moving jaw: from steps of its motor to the gap between the tips, and back."""

from __future__ import annotations

from math import asin, cos, pi, sin
from typing import Final, NamedTuple

from graspsense_so101_gripper.registers import STEPS

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
