"""The clock of a device against that of the host: offset, drift, and how far off they can be.

A value is measured at a device time and arrives at a host time. What lies between is the offset of the clocks and a
delay, which is never negative and now and then short. The fastest arrival of each second is therefore kept, and a line
through these, with the median of all slopes between them (Theil and Sen), gives offset and drift.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable
from math import inf, nan
from statistics import median
from typing import Final, NamedTuple, final

BLOCK_S: Final = 1.0
"""Time of which the fastest arrival is kept."""
BLOCKS: Final = 20
"""Blocks that the line goes through: twenty seconds."""
DRIFT_LIMIT: Final = 2e-4
"""Drift of two crystals that is possible at most, before the line is known: 100 parts in a million each."""


class ClockLine(NamedTuple):
    """Host time less device time: `offset_s` at the device time `at_s`, which changes by `drift` (s per s).

    `uncertainty_s` is how far off the offset can be at `at_s`: the largest distance of a kept arrival from the line.
    The
    shortest delay of all is part of the offset, so a constant one cannot be told from it.
    """

    at_s: float
    offset_s: float
    drift: float
    uncertainty_s: float

    def host_s(self, device_s: float) -> float:
        """Return the host time at which a value of this device time would arrive with the shortest delay."""
        return device_s + self.offset_s + self.drift * (device_s - self.at_s)


UNKNOWN: Final = ClockLine(0.0, nan, nan, inf)


@final
class DeviceClock:
    """Takes the device and host time of each arrival. It needs no thread, and memory for twenty numbers."""

    def __init__(self) -> None:
        self._kept: deque[tuple[float, float]] = deque(maxlen=BLOCKS)
        self._block = (nan, inf)
        self._began_s = -inf
        self._line = UNKNOWN
        self._delays: deque[float] = deque(maxlen=1000)

    def age_s(self, device_s: float, host_s: float) -> float:
        """Take an arrival and return how old its value is (s): its delay beyond the shortest one."""
        offset_s = host_s - device_s
        if host_s - self._began_s > BLOCK_S:
            self._end_block(host_s)
        if offset_s < self._block[1] or self._block[1] == inf:
            self._block = device_s, offset_s
        age_s = self._age(device_s, offset_s)
        self._delays.append(age_s)
        return age_s

    def latency_s(self) -> float:
        """Return the median age (s) of the last thousand arrivals; NaN before the first."""
        return median(self._delays) if self._delays else nan

    def line(self) -> ClockLine:
        """Return offset and drift of the last twenty seconds; before the first second is over, of what came."""
        return self._line if self._kept else _line_of([self._block]) if self._block[1] < inf else UNKNOWN

    def _age(self, device_s: float, offset_s: float) -> float:
        fastest_s = self._block[1]
        if self._kept:
            predicted_s = self._line.host_s(device_s) - device_s
            fastest_s = min(fastest_s, predicted_s)
        return max(offset_s - fastest_s, 0.0)

    def _end_block(self, host_s: float) -> None:
        if self._block[1] < inf:
            self._kept.append(self._block)
            self._line = _line_of(list(self._kept))
        self._began_s, self._block = host_s, (nan, inf)


def clock_report(name: str, clock: DeviceClock, channels: Iterable[str]) -> dict[str, float | str]:
    """Return for `SensorBackend.report` which channels have the times of this clock, and how sure these are.

    Each has the host's time of its device's time. `Trial.apart_s` tells from it how far two channels can be apart.
    """
    line = clock.line()
    return {
        f"{name}_channels": " ".join(channels),
        f"{name}_offset_s": line.offset_s,
        f"{name}_drift": line.drift,
        f"{name}_uncertainty_s": line.uncertainty_s,
        f"{name}_latency_s": clock.latency_s(),
    }


def _line_of(points: list[tuple[float, float]]) -> ClockLine:
    """Return the line through the fastest arrivals: the median slope, and the median offset at the last of them."""
    at_s = points[-1][0]
    slopes = [
        (later[1] - earlier[1]) / (later[0] - earlier[0])
        for i, later in enumerate(points)
        for earlier in points[:i]
        if later[0] > earlier[0]
    ]
    known = len(points) > 2 and slopes
    drift = min(max(median(slopes), -DRIFT_LIMIT), DRIFT_LIMIT) if known else 0.0
    offsets = [offset_s - drift * (device_s - at_s) for device_s, offset_s in points]
    middle_s = median(offsets)
    spread_s = max(abs(offset_s - middle_s) for offset_s in offsets)
    unknown_s = 0.0 if known else DRIFT_LIMIT * BLOCK_S * len(points)
    return ClockLine(at_s, middle_s, drift, spread_s + unknown_s)
