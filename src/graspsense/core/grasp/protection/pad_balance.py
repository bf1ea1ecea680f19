"""Two pads that feel different forces at rest, although they hold the same object."""

from __future__ import annotations

from typing import Final

from graspsense.core.grasp.protection.recent_mean import RecentMean
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

MEAN_S: Final = 0.1
"""Time over which the forces are averaged, and after which they are compared."""
ALLOWED_N: Final = 2.0
"""Difference that friction can hold: 1.5 N for half a kilogram on a table."""
ALLOWED_SHARE: Final = 1.0 / 3.0
"""Difference that is allowed, as a share of the larger force: calibrations differ."""


class PadBalance:
    """Compares the forces of both pads while the fingers hold."""

    def __init__(self) -> None:
        self._left, self._right = RecentMean(MEAN_S), RecentMean(MEAN_S)
        self._seen_s = 0.0

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the hold, and return a difference that no calibration explains."""
        self._left.add(frame.force_left_n, frame.dt_s)
        self._right.add(frame.force_right_n, frame.dt_s)
        self._seen_s += frame.dt_s
        forces = {"left": self._left.value, "right": self._right.value}
        if self._seen_s < MEAN_S or not abs(forces["left"] - forces["right"]) > ALLOWED_N:
            return None
        weak, strong = sorted(forces, key=lambda side: forces[side])
        if forces[strong] - forces[weak] <= ALLOWED_SHARE * forces[strong]:
            return None
        return Fault(
            "pads disagree",
            f"at rest the {weak} pad feels {forces[weak]:.1f} N and the {strong} one {forces[strong]:.1f} N, though "
            "both hold the same object: check the calibration and the cells of both",
        )
