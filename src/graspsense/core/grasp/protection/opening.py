"""Whether the fingers open after the hold, and as soon as a gripper acts on a command.

A gap that stands still in a squeeze may be at rest. When the fingers are told to open, it has to change.
"""

from __future__ import annotations

from math import inf, nan
from typing import Final

from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import APPROACH, Frame, Phase

LEAST_TRAVEL_M: Final = 0.003
"""Travel of the closing from which on the opening must show."""
OPENED_M: Final = 0.001
"""Change of the gap that shows it."""
LATE_S: Final = 0.2
"""Time beyond the delay of a command after which the gap is late; at least four frames."""
STANDS_S: Final = 0.5
"""Time beyond it after which the fingers count as not opened; at least six frames."""


class Opening:
    """Watches the gap in the release of a gripper with this rate of frames (Hz) and delay of commands (s)."""

    def __init__(self, rate_hz: float, command_delay_s: float) -> None:
        self._late_s = command_delay_s + max(LATE_S, 4.0 / rate_hz)
        self.stands_s = command_delay_s + max(STANDS_S, 6.0 / rate_hz)
        """Time (s) after which fingers that stand still have not opened."""
        self._widest_m = -inf
        self._start_m = self._start_s = nan
        self._opened = False

    def see(self, frame: Frame, phase: int) -> Fault | None:
        """Take the frame of a tick; return what is wrong with the opening."""
        if phase != Phase.RELEASE:
            if phase >= APPROACH:
                self._widest_m = max(self._widest_m, frame.gap_m)
                self._start_m, self._start_s = frame.gap_m, frame.t_s
            return None
        if self._opened or not self._widest_m - self._start_m >= LEAST_TRAVEL_M:
            return None
        elapsed_s = frame.t_s - self._start_s
        self._opened = abs(frame.gap_m - self._start_m) >= OPENED_M
        if self._opened:
            return None if elapsed_s <= self._late_s else self._late(elapsed_s)
        if elapsed_s < self.stands_s:
            return None
        return Fault(
            "fingers did not open",
            f"the gap still is {frame.gap_m * 1e3:.1f} mm, {elapsed_s:.1f} s after they were told to: they hold on, or "
            "the gap has stood still for longer, so that what follows from it is wrong; look at the fingers and the "
            "encoder",
        )

    def _late(self, elapsed_s: float) -> Fault:
        return Fault(
            "gap late",
            f"it changed only {elapsed_s:.2f} s after the fingers were told to open: times and rates of the "
            "squeeze can be off by that; check the connection",
        )
