"""Checks the times in the reports of a board: that they pass, and as fast as those of the host.

A grasp measures speeds and durations in device time, and its time limits too. A clock that stands still or runs wrongly
would keep the fingers squeezing.
"""

from __future__ import annotations

import math
from typing import Final

STILL_REPORTS: Final = 50
"""Consecutive reports whose time does not pass, after which the clock counts as broken: 50 ms."""
COUNTED_OFF_S: Final = 0.1
"""Largest difference between the time that passed and the periods of the reports, in `COUNTED_S`."""
COUNTED_S: Final = 60.0
"""Time after which the count begins again, so that two good crystals never differ by so much."""
AHEAD_S: Final = 0.5
"""Time by which no report can be ahead of the fastest one of the window before, also on a host that was held up."""
WINDOW_S: Final = 2.0


class ClockFault(Exception):
    """The clock of the device cannot be right."""


class PassingTime:
    """Takes the times of newer and newer reports."""

    def __init__(self) -> None:
        self.still = 0
        """Number of consecutive reports whose time was not after that of all before."""
        self._latest_us = -1

    def passes(self, time_us: int) -> bool:
        """Return whether a newer report has a later time. Raises ClockFault if the time stands still."""
        if time_us > self._latest_us:
            self._latest_us, self.still = time_us, 0
            return True
        self.still += 1
        if self.still >= STILL_REPORTS:
            raise ClockFault(self.words)
        return False

    @property
    def words(self) -> str:
        """What is wrong with the last `still` reports."""
        return (
            f"its clock stood still or went back: {self.still} reports in a row came after device time "
            + (f"{self._latest_us / 1e6:.3f} s with no later time")
        )


class CountedTime:
    """Holds device time against the number of reports, each of which stands for one period.

    Without `numbers_all`, more time may pass: a board that cannot send a report for a while may give it no number.
    """

    def __init__(self, period_us: int, numbers_all: bool) -> None:
        self._period_us = period_us
        self._numbers_all = numbers_all
        self._began: tuple[int, int] | None = None

    def check(self, sequence: int, time_us: int) -> None:
        """Take a report. Raises ClockFault."""
        if self._began is None:
            self._began = sequence, time_us
        began_sequence, began_us = self._began
        counted_s = ((sequence - began_sequence) & 0xFFFFFFFF) * self._period_us * 1e-6
        passed_s = (time_us - began_us) * 1e-6
        if passed_s < counted_s - COUNTED_OFF_S or (
            self._numbers_all and passed_s > counted_s + COUNTED_OFF_S
        ):
            raise ClockFault(
                f"its clock is wrong: {passed_s:.3f} s of device time passed in reports of {counted_s:.3f} s"
            )
        if passed_s > COUNTED_S:
            self._began = None


class HostTime:
    """Holds device time against the host's: no report can be from the future.

    A clock that falls behind makes every report look old, and `link` discards those.
    """

    def __init__(self) -> None:
        self._since_s = -math.inf
        self._fastest_s = self._before_s = math.inf

    def check(self, device_s: float, host_s: float) -> None:
        """Take a report that the host read at `host_s`. Raises ClockFault."""
        offset_s = host_s - device_s
        if host_s - self._since_s > WINDOW_S:
            self._since_s = host_s
            self._before_s, self._fastest_s = self._fastest_s, offset_s
        self._fastest_s = min(self._fastest_s, offset_s)
        ahead_s = self._before_s - offset_s
        if AHEAD_S < ahead_s < math.inf:
            raise ClockFault(
                f"its clock jumped or runs fast: by the clock of this computer it gained {ahead_s:.3f} s"
            )
