"""What was lost between a gripper and the controller: frames by their times, images and samples by their counters."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from graspsense.core.values.errors import counted
from graspsense.core.values.signals import Reading, Samples

FRAMES: Final = "frames"
LATE: Final = 1.5
"""Periods of the declared rate from which on at least one frame is missing."""


class Losses:
    """Counts, tick by tick, what a gripper with this rate of frames (Hz) has measured and nobody has seen."""

    def __init__(self, rate_hz: float) -> None:
        self._rate_hz, self._late_s = rate_hz, LATE / rate_hz
        self._last: Reading | None = None
        self.lost: dict[str, int] = {}
        """The number of lost frames, and of lost images or samples of each channel that lost some."""

    def see(self, reading: Reading) -> None:
        """Take the reading of a tick."""
        last, self._last = self._last, reading
        if last is None:
            return
        frame, pads, signals = reading
        if frame.dt_s > self._late_s:
            self._add(FRAMES, round(frame.dt_s * self._rate_hz) - 1)
        if pads is not last.pads and last.pads.counter:
            self._add("pads", pads.counter - last.pads.counter - 1)
        if signals is not last.signals:
            for name, earlier, now in zip(signals._fields, last.signals, signals, strict=True):
                self._add(name, _missing(earlier, now))

    def _add(self, name: str, count: int) -> None:
        if count > 0:
            self.lost[name] = self.lost.get(name, 0) + count

    def counts(self) -> dict[str, int]:
        """Return the losses under the names that the counts of a grasp have."""
        return {f"lost_{name}": count for name, count in self.lost.items()}


def _missing(earlier: Any, now: Any) -> int:
    """Return the number of images or samples between two values of a channel that were lost."""
    counter = getattr(earlier, "counter", 0)
    if not counter or now.counter == counter:
        return 0
    return int(now.counter - counter - (now.new if isinstance(now, Samples) else 1))


def lost_in_words(lost: Mapping[str, int]) -> str:
    """Return what was lost, in words, as the outcome of a grasp says it; empty if nothing was.

    >>> lost_in_words({"frames": 3, "pads": 1})
    'lost: 3 frames, 1 of pads'
    """
    parts = [
        counted(count, "frame") if name == FRAMES else f"{count} of {name}" for name, count in lost.items()
    ]
    return f"lost: {', '.join(parts)}" if parts else ""
