"""The fingers of an emulated gripper that closes by itself: a body that takes an effort, driven to a target."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import Any, Final, NamedTuple

from graspsense.core.drivers.emulated_body import opened_body
from graspsense.core.values.signals import EFFORT, Command

GAIN_N_S_M: Final = 15000.0
INTEGRAL_N_M: Final = 2000.0
"""Effort per error of the speed, and per error of the way."""
NEAR_S: Final = 0.02
"""The fingers slow down over the way of this time at their speed."""
REST_M_S: Final = 1e-3
"""Speed of fingers that have met something."""
CATCH_UP_S: Final = 5.0
"""Most time that is made up at once: by then the fingers have come to rest."""


class FingerTarget(NamedTuple):
    """Where the fingers go (gap in m), how fast at most (m/s), and with which force at most (N)."""

    gap_m: float
    speed_m_s: float
    force_n: float


class EmulatedFingers:
    """Fingers with this stroke (m) over the backend `body`, at the time (s) that each call gives.

    A hand with a shorter stroke than the body has its fingers mounted closer together; None takes the body's stroke.
    Raises ConfigError for a body that has a clock of its own.
    """

    def __init__(
        self,
        body: str,
        settings: Mapping[str, Any],
        scene: str | None,
        seed: int,
        stroke_m: float | None = None,
    ) -> None:
        self.body, info = opened_body(body, settings, scene, seed)
        self.tick_s = 1.0 / info.rate_hz
        self.rest_s = 0.0
        """For how long (s) the fingers have been at rest on their way."""
        self._integral_n = self._body_s = 0.0
        self._frame = self._read()
        self.stroke_m = float(self._frame.gap_m) if stroke_m is None else stroke_m
        self._offset_m = max(float(self._frame.gap_m) - self.stroke_m, 0.0)

    @property
    def gap_m(self) -> float:
        """The gap between the fingers."""
        return float(self._frame.gap_m - self._offset_m)

    @property
    def velocity_m_s(self) -> float:
        """The rate of the gap."""
        return float(self._frame.velocity_m_s)

    @property
    def effort_n(self) -> float:
        """The effort of the motor."""
        return float(self._frame.effort_n)

    @property
    def forces_n(self) -> tuple[float, float]:
        """The forces on the pads of the body."""
        return float(self._frame.force_left_n), float(self._frame.force_right_n)

    def move(self, now_s: float, target: FingerTarget | None) -> None:
        """Move up to this time towards the target; without one, without an effort."""
        self._body_s = max(self._body_s, now_s - CATCH_UP_S)
        while self._body_s + self.tick_s <= now_s:
            self._body_s += self.tick_s
            effort_n = 0.0 if target is None else self._effort(target)
            self.body.apply(Command(EFFORT, effort_n, inf, inf))
            self._frame = self._read()

    def close(self) -> None:
        """Release the body."""
        self.body.close()

    def _read(self) -> Any:
        reading = self.body.read(1.0)
        if reading is None:
            raise RuntimeError("the body of an emulated gripper gave no frame: it needs a virtual clock")
        return reading.frame

    def _effort(self, target: FingerTarget) -> float:
        """Return the effort of the next tick: a loop of the speed, whose effort is at most the force of the target."""
        # A target beyond the stroke is reached at the end of the stroke.
        way_m = self.gap_m - target.gap_m
        wanted = min(max(way_m / NEAR_S, -target.speed_m_s), target.speed_m_s)
        error = wanted + self._frame.velocity_m_s
        effort = GAIN_N_S_M * error + self._integral_n
        if abs(effort) < target.force_n:
            self._integral_n += INTEGRAL_N_M * self.tick_s * error
        rests = abs(self._frame.velocity_m_s) < REST_M_S
        self.rest_s = self.rest_s + self.tick_s if rests else 0.0
        return float(min(max(effort, -target.force_n), target.force_n))
