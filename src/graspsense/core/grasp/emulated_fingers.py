"""The fingers of an emulated gripper that goes to its target on its own, over a body that takes an effort."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, Final, NamedTuple

from graspsense.core.components.config import create
from graspsense.core.components.roles import SensorBackend
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.signals import EFFORT, Command, Frame

GAIN_N_S_M: Final = 15000.0
INTEGRAL_N_M: Final = 2000.0
"""Effort per error of the speed, and per error of the way."""
NEAR_S: Final = 0.02
"""The fingers slow down over the way of this time at their speed."""
REST_M_S: Final = 1e-3
"""Speed of fingers that have met something."""
CATCH_UP_S: Final = 5.0
"""Most time that is made up at once: by then the fingers have come to rest."""


class Goal(NamedTuple):
    """Where the fingers go, and how fast and how hard at most."""

    gap_m: float
    speed_m_s: float
    force_n: float


class EmulatedFingers:
    """The body `name` with these settings, at the time (s) that each `look` gives.

    Its fingers are mounted closer together where `stroke_m` is shorter than theirs. `goal` is None while the motor is
    off. Raises ConfigError for a body that has a clock of its own.
    """

    def __init__(self, name: str, settings: Mapping[str, Any], stroke_m: float, seed: int) -> None:
        self.body: SensorBackend[Any] = create("sensor-backend", name, **settings)
        info = self.body.open(seed)
        if info.clock != "virtual":
            self.body.close()
            raise ConfigError(
                f"gripper.body {name!r} has a clock of its own, so no gripper can be emulated over it: name a "
                "gripper with a virtual clock, such as sim"
            )
        self.goal: Goal | None = None
        self.rest_s = 0.0
        """Time for which the fingers have rested since they were sent to the present goal."""
        self._tick_s = 1.0 / info.rate_hz
        self._integral_n = self._body_s = 0.0
        self._frame = self._read()
        self._offset_m = max(self._frame.gap_m - stroke_m, 0.0)

    @property
    def gap_m(self) -> float:
        """The gap between the fingers."""
        return float(self._frame.gap_m - self._offset_m)

    @property
    def forces_n(self) -> tuple[float, float]:
        """The forces on the left and the right pad of the body."""
        return float(self._frame.force_left_n), float(self._frame.force_right_n)

    @property
    def effort_n(self) -> float:
        """The effort of the motor."""
        return float(self._frame.effort_n)

    def look(self, now_s: float) -> None:
        """Move on up to this time."""
        self._body_s = max(self._body_s, now_s - CATCH_UP_S)
        while self._body_s + self._tick_s <= now_s:
            self._body_s += self._tick_s
            self.body.apply(Command(EFFORT, self._effort(), inf, inf))
            self._frame = self._read()

    def close(self) -> None:
        """Release the body."""
        self.body.close()

    def _read(self) -> Frame:
        reading = self.body.read(1.0)
        if reading is None:
            raise RuntimeError("the body of an emulated gripper gave no frame: it needs a virtual clock")
        return reading.frame

    def _effort(self) -> float:
        """Return the effort of the next tick: a loop of the speed, whose effort is at most the force of the goal."""
        if self.goal is None:
            self._integral_n = self.rest_s = 0.0
            return 0.0
        goal_m, speed, most_n = self.goal
        way_m = self.gap_m - goal_m
        wanted = min(max(way_m / NEAR_S, -speed), speed)
        error = wanted + self._frame.velocity_m_s
        effort = GAIN_N_S_M * error + self._integral_n
        if abs(effort) < most_n:
            self._integral_n += INTEGRAL_N_M * self._tick_s * error
        rests = abs(self._frame.velocity_m_s) < REST_M_S
        self.rest_s = self.rest_s + self._tick_s if rests else 0.0
        return float(min(max(effort, -most_n), most_n))
