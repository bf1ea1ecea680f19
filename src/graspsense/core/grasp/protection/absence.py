"""Whether a measurement is no number for longer than a moment, or again and again."""

from __future__ import annotations

from math import isfinite, nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

ABSENT_S: Final = 0.1
"""Time for which a measurement may be no number; at least three frames."""
AGAIN: Final = 5
AGAIN_SHARE: Final = 0.02
"""Frames without a number, and their share, from which on they are told."""
GAP_ABSENT: Final = Fault(
    "gap absent",
    "it is no number any more, or below zero: check the encoder and the sign of the gap",
    ends=True,
)
EFFORT_ABSENT: Final = Fault(
    "effort absent",
    "the gripper does not tell its effort, so what follows from it is missing: check its current or load sensor",
)


class Absence:
    """Watches one measurement of frames with this rate (Hz), whose absence is this fault. Infinity is absence too.

    One that is not `expected` is missed only after it was there.
    """

    def __init__(self, fault: Fault, rate_hz: float, *, expected: bool) -> None:
        self._fault, self._expected = fault, expected
        self._allowed_s = max(ABSENT_S, 3.0 / rate_hz)
        self._known_s = nan
        self._frames = self._absent = 0

    def see(self, value: float, frame: Frame) -> Fault | None:
        """Take the value of the measurement in this frame; return the fault once it has been no number for too long.

        One that is no number again and again has the fault too, which then does not end the grasp.
        """
        is_known = isfinite(value)
        if is_known or (self._expected and self._known_s != self._known_s):
            self._known_s = frame.t_s
        if frame.t_s - self._known_s > self._allowed_s:
            return self._fault
        if self._known_s == self._known_s:
            self._frames += 1
            self._absent += not is_known
        if is_known or self._absent < max(AGAIN, AGAIN_SHARE * self._frames):
            return None
        return Fault(
            self._fault.name,
            f"{self._absent} of {self._frames} frames do not tell it, so that what follows from it is wrong or "
            "missing: check its sensor and the connection",
        )
