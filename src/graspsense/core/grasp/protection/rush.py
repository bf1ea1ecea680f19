"""Whether the fingers approach faster than they may: a gripper that closes by itself may take no limit of the speed."""

from __future__ import annotations

from math import nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import Frame

RUSH: Final = 3.0
"""Speed over the limit of a first use from which on the fingers rush: a loop overshoots when it starts."""
RUSH_S: Final = 0.1
"""Time for which they must do so; at least three frames."""


class Rush:
    """Watches the speed of an approach in which nothing has been felt. `limit_m_s` is the limit of a first use."""

    def __init__(self, limit_m_s: float, rate_hz: float) -> None:
        self._limit_m_s, self._lasts_s = limit_m_s, max(RUSH_S, 3.0 / rate_hz)
        self._since_s = nan

    def see(self, frame: Frame) -> Fault | None:
        """Take the frame of a tick of the approach, and return the fault if the fingers rush."""
        if not -frame.velocity_m_s > RUSH * self._limit_m_s:
            self._since_s = nan
            return None
        if self._since_s != self._since_s:
            self._since_s = frame.t_s
        if frame.t_s - self._since_s < self._lasts_s:
            return None
        return Fault(
            "fingers rush",
            f"they close at {-frame.velocity_m_s * 1e3:.0f} mm/s, and {self._limit_m_s * 1e3:.0f} mm/s are allowed "
            "before a contact (run.first_speed_m_s): the gripper does not keep the speed of its commands; send it "
            "a position or a velocity instead of an effort",
            ends=True,
        )
