"""Whether a measurement is no number for longer than a moment."""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

ABSENT_S: Final = 0.1
"""Time for which a measurement may be no number; at least three frames."""
GAP_ABSENT: Final = Fault(
    "gap absent", "the gripper does not tell its gap any more: check its encoder", ends=True
)
EFFORT_ABSENT: Final = Fault(
    "effort absent",
    "the gripper does not tell its effort, so what follows from it is missing: check its current or load sensor",
)


class Absence:
    """Watches one measurement of frames with this rate (Hz), whose absence is this fault.

    One that is not `expected` is missed only after it was there.
    """

    def __init__(self, fault: Fault, rate_hz: float, *, expected: bool) -> None:
        self._fault, self._expected = fault, expected
        self._allowed_s = max(ABSENT_S, 3.0 / rate_hz)
        self._known_s = nan

    def see(self, value: float, frame: Frame) -> Fault | None:
        """Take the value of the measurement in this frame; return the fault once it has been no number for too long."""
        if value == value or (self._expected and self._known_s != self._known_s):
            self._known_s = frame.t_s
        return self._fault if frame.t_s - self._known_s > self._allowed_s else None
