"""Whether the effort that a gripper reports of its motor can be one: its sign, whether it changes, and how steadily.

This holds whatever the scale of the effort is, which many grippers do not know. A scale that is wrong from the
beginning on does not show.
"""

from __future__ import annotations

from math import nan
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n
from graspsense.core.grasp.protection.motor import ALLOWED_N, MOVES_M_S, direction_of, lasting
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, EFFORT, Command, Frame, Phase

WRONG_SIGN_S: Final = 0.3
"""Time for which the effort of fingers that press may have the sign of opening ones."""
OPENED_M: Final = 0.005
"""Way from which on the effort of fingers that open, and then rest, is not always that with which they held."""
FEWEST: Final = 10
"""Frames in motion to each side from which on their efforts are compared."""
CLOSES_FREELY: Final = 0.1
OPENS_FREELY: Final = 0.25
"""Share of the efforts that are below that of a free motion: fingers speed up first, and press or brake in the end."""
AT_LIMIT: Final = 0.6
"""Share of the largest effort of an approach from which on it says nothing of a free motion."""
SATURATED: Final = 0.05
"""Share of the limit of a command by which an effort at this limit differs from it."""
MOST_CLOSING: Final = 0.75
MOST_OPENING: Final = 0.5
"""Shares of a motion at the limit from which on it does not tell what a free one takes: fingers that mostly move with
as much as they may do not reach their speed, or push something."""
DIFFERS_N: Final = 3.0
DIFFERS_SHARE: Final = 0.15
"""By how much free motions to both sides may differ, at least and as a share of the largest effort in the closing."""
NOISY_N: Final = 2.0
NOISY_SHARE: Final = 0.05
"""By how much, likewise, half of the efforts of a motion may differ from those of the frame before."""


class ReportedEffort:
    """Watches the effort of a gripper from the approach to the release."""

    def __init__(self) -> None:
        self._direction, self._limit_n = 0, nan
        self._wrong_sign_s = 0.0
        self._effort_n = self._since_s = self._gap_m = nan
        self._changed = False
        self._has_own_loop = self._has_wrong_sign = False
        self._most_n = self._most_approach_n = 0.0
        self._closing: list[tuple[float, float]] = []
        self._opening: list[tuple[float, float]] = []
        """The effort of each frame in motion, of the approach and of the release, with the limit of its command (N)."""

    def apply(self, frame: Frame, command: Command) -> None:
        """Take the command that is applied after this frame. The motor is compared with one of an effort elsewhere."""
        self._has_own_loop = command.kind != EFFORT
        self._direction = direction_of(command, frame.gap_m) if self._has_own_loop else 0
        self._limit_n = asked_effort_n(command)

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick and return what its effort shows."""
        if phase < APPROACH:
            return None
        opens = phase == Phase.RELEASE
        if self._has_own_loop and (opens or phase == APPROACH) and abs(frame.velocity_m_s) > MOVES_M_S:
            (self._opening if opens else self._closing).append((frame.effort_n, self._limit_n))
        if opens:
            self._changed = self._changed or frame.effort_n != self._effort_n
            return None
        self._most_n = max(self._most_n, frame.effort_n)
        if phase == APPROACH:
            self._most_approach_n = self._most_n
        if frame.effort_n != self._effort_n:
            self._effort_n, self._since_s = frame.effort_n, frame.t_s
        self._gap_m = frame.gap_m
        presses = self._direction == 1 and abs(frame.velocity_m_s) < MOVES_M_S
        self._wrong_sign_s = lasting(self._wrong_sign_s, presses and frame.effort_n < -ALLOWED_N, frame.dt_s)
        if self._wrong_sign_s <= WRONG_SIGN_S:
            return None
        self._has_wrong_sign = True
        return Fault(
            "effort has the wrong sign",
            f"it is {frame.effort_n:.1f} N while the fingers press to close, which is that of opening ones: check the "
            "sign of its scale; what follows from it is wrong or missing",
        )

    def released(self, frame: Frame) -> Fault | None:
        """Take the last frame of the release; return what the efforts of the whole grasp show.

        An effort without a sign can be the same for a while, where the motor holds and opens at the same limit.
        """
        if self._changed or not frame.gap_m - self._gap_m >= OPENED_M:
            return None if self._has_wrong_sign else self._noisy() or self._unlike()
        return Fault(
            "effort stuck",
            f"it has stood at {self._effort_n:.1f} N for {frame.t_s - self._since_s:.1f} s, also while the fingers "
            "opened: what follows from it is wrong or missing; check the current or load sensor",
        )

    def _noisy(self) -> Fault | None:
        """Return the fault of an effort that scatters from frame to frame."""
        scatter_n = max(
            (
                float(np.median(np.abs(np.diff(moving, axis=0)[:, 0])))
                for moving in (self._closing, self._opening)
                if len(moving) >= FEWEST
            ),
            default=nan,
        )
        if not scatter_n > max(NOISY_N, NOISY_SHARE * self._most_n):
            return None
        return Fault(
            "effort noisy",
            f"of fingers that move it differs by {scatter_n:.1f} N from frame to frame, so that a contact found by it "
            "is uncertain; check the current or load sensor",
        )

    def _unlike(self) -> Fault | None:
        """Return the fault of an effort that opening fingers need, and closing ones did not, or the reverse.

        Its zero has drifted, or its scale has changed. An effort has a sign if it has been below zero in the release.
        """
        closing = free_efforts(self._closing, MOST_CLOSING)
        opening = free_efforts(self._opening, MOST_OPENING)
        if min(len(closing), len(opening)) < FEWEST:
            return None
        if np.min(opening) < -ALLOWED_N:
            opening = -opening
        closing_n = float(np.quantile(closing, CLOSES_FREELY))
        opening_n = float(np.quantile(opening, OPENS_FREELY))
        if closing_n >= AT_LIMIT * self._most_approach_n or not abs(opening_n - closing_n) > max(
            DIFFERS_N, DIFFERS_SHARE * self._most_n
        ):
            return None
        return Fault(
            "effort not as before",
            f"fingers that move freely need {opening_n:.1f} N to open, and needed {closing_n:.1f} N to close: its zero "
            "drifts or its scale has changed, so that a contact found by it is uncertain; check the current or load "
            "sensor",
        )


def free_efforts(moving: list[tuple[float, float]], most: float) -> NDArray[np.float64]:
    """Return the efforts of a motion, none if more than this share are at the limits that come with them (N)."""
    efforts, limits = np.reshape(moving, (-1, 2)).T
    at_limit = np.abs(np.abs(efforts) - limits) <= SATURATED * limits
    return efforts if at_limit.sum() <= most * len(efforts) else efforts[:0]
