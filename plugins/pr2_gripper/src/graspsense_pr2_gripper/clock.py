"""Estimates the offset between the clocks of host and device, and from it the age of a report."""

from __future__ import annotations

import math
from typing import Final

WINDOW_S: Final = 5.0
"""The offset is the smallest of one to two windows: at 100 parts in a million a clock drifts 1 ms in two of them."""


class DeviceClock:
    """Estimates the offset of the host's clock over the device's from the reports that came fastest."""

    def __init__(self) -> None:
        self._since_s = -math.inf
        self._smallest = self._before = math.inf

    @property
    def offset_s(self) -> float:
        """Host time less device time, with the shortest delay seen; NaN before the first report."""
        smallest = min(self._smallest, self._before)
        return smallest if smallest < math.inf else math.nan

    def age_s(self, device_s: float, host_s: float) -> float:
        """Take a report of this device time, read at this host time; return how old it is, 0 for the fastest."""
        if host_s - self._since_s > WINDOW_S:
            self._since_s, self._before, self._smallest = host_s, self._smallest, math.inf
        offset = host_s - device_s
        self._smallest = min(self._smallest, offset)
        return offset - min(self._smallest, self._before)
