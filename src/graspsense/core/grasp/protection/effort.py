"""Whether the effort that a gripper reports of its motor can be one: it has the right sign, and it changes.

This holds whatever the scale of the effort is, which many grippers do not know.
"""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.grasp.protection.motor import ALLOWED_N, MOVES_M_S, direction_of, lasting
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, EFFORT, Command, Frame, Phase

WRONG_SIGN_S: Final = 0.3
"""Time for which the effort of fingers that press may have the sign of opening ones."""
OPENED_M: Final = 0.005
"""Way from which on the effort of fingers that open, and then rest, is not always that with which they held."""


class ReportedEffort:
    """Watches the effort of a gripper from the approach to the release."""

    def __init__(self) -> None:
        self._direction = 0
        self._wrong_sign_s = 0.0
        self._effort_n = self._since_s = self._gap_m = nan
        self._changed = False

    def apply(self, frame: Frame, command: Command) -> None:
        """Take the command that is applied after this frame. The motor is compared with one of an effort elsewhere."""
        self._direction = 0 if command.kind == EFFORT else direction_of(command, frame.gap_m)

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick and return what its effort shows."""
        if phase < APPROACH:
            return None
        if phase == Phase.RELEASE:
            self._changed = self._changed or frame.effort_n != self._effort_n
            return None
        if frame.effort_n != self._effort_n:
            self._effort_n, self._since_s = frame.effort_n, frame.t_s
        self._gap_m = frame.gap_m
        presses = self._direction == 1 and abs(frame.velocity_m_s) < MOVES_M_S
        self._wrong_sign_s = lasting(self._wrong_sign_s, presses and frame.effort_n < -ALLOWED_N, frame.dt_s)
        if self._wrong_sign_s <= WRONG_SIGN_S:
            return None
        return Fault(
            "effort has the wrong sign",
            f"it is {frame.effort_n:.1f} N while the fingers press to close, which is that of opening ones: check the "
            "sign of its scale; what follows from it is wrong or missing",
        )

    def released(self, frame: Frame) -> Fault | None:
        """Take the last frame of the release; return whether the effort has stood still since the fingers held.

        An effort without a sign can be the same for a while, where the motor holds and opens at the same limit.
        """
        if self._changed or not frame.gap_m - self._gap_m >= OPENED_M:
            return None
        return Fault(
            "effort stuck",
            f"it has stood at {self._effort_n:.1f} N for {frame.t_s - self._since_s:.1f} s, also while the fingers "
            "opened: what follows from it is wrong or missing; check the current or load sensor",
        )
