"""Whether the fingers move with less effort than their friction takes: a motor that is stronger than it reports."""

from __future__ import annotations

from typing import Final

from graspsense.core.grasp.protection.effort_ceiling import asked_effort_n
from graspsense.core.grasp.protection.recent_mean import RecentMean
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import EFFORT, Command, Frame

MEAN_S: Final = 0.2
"""Time over which the effort is averaged."""
TRAVEL_M: Final = 0.005
"""Travel before the effort is judged: the fingers start with more than they then need."""
MOVES_M_S: Final = 0.001
"""Speed from which on the fingers move."""
WARNS: Final = 0.6
ENDS: Final = 0.4
"""Shares of the friction below which the effort is told, and ends the grasp: what moves needs less than what starts."""


class FreeEffort:
    """Compares the effort of an approach in free air with the friction of the drive (N; 0: it is not known)."""

    def __init__(self, friction_n: float) -> None:
        self._friction_n = friction_n
        self._mean_n = RecentMean(MEAN_S)
        self._travel_m = 0.0

    def see(self, frame: Frame, applied: Command) -> Fault | None:
        """Take the frame of a tick of the approach in which nothing is felt, and the command that is applied."""
        if applied.kind != EFFORT or not -frame.velocity_m_s > MOVES_M_S:
            return None
        self._travel_m -= frame.velocity_m_s * frame.dt_s
        self._mean_n.add(asked_effort_n(applied), frame.dt_s)
        mean_n = self._mean_n.value
        if self._travel_m < TRAVEL_M or not mean_n < WARNS * self._friction_n:
            return None
        return Fault(
            "moves too easily",
            f"the fingers move with {mean_n:.1f} N, and their friction is {self._friction_n:.1f} N: the motor may "
            "press with more than it reports; check its scale, or measure the friction again (graspsense calibrate "
            "friction)",
            ends=mean_n < ENDS * self._friction_n,
        )
