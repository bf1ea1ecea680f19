"""What was lost between a gripper and the controller: frames by their times, images and samples by their counters."""

from __future__ import annotations

from math import isfinite
from typing import Any, Final

from graspsense.core.values.errors import counted
from graspsense.core.values.faults import Fault
from graspsense.core.values.signals import CLOSING, Reading, Samples

FRAMES: Final = "frames"
FRAMES_LOST: Final = "frames lost"
"""The name of the fault of a gripper that loses many frames."""
LOST_SHARE: Final = 0.02
"""Share of lost frames from which on a person must know: derivatives of the force then change."""
ENDS_SHARE: Final = 0.5
"""Share of lost frames that ends the grasp: a controller that sees half of them does not control."""
FEWEST: Final = 200
"""Frames, with the lost ones, after which a share is told."""
SLOW_S: Final = 2.0
"""Time after which a share of a slow gripper is told, and by single gaps: its rate is the highest that it has."""
SINGLE_GAPS: Final = 3
SINGLE_SHARE: Final = 0.05
"""Frames of a slow gripper that are missing, and their share, from which on they are told."""


class Losses:
    """Counts, tick by tick, what a gripper with this rate of frames (Hz) has measured and nobody has seen."""

    def __init__(self, rate_hz: float) -> None:
        self._period_s = 1.0 / rate_hz
        self._last: Reading | None = None
        self._image_t_s = 0.0
        self._frames = self._singly_lost = 0
        self._expected = 0.0
        self._longest_s = 0.0
        """The longest time (s) of which something was lost."""
        self.lost: dict[str, int] = {}
        """The number of lost frames, and of lost images or samples of each channel that lost some."""

    def see(self, reading: Reading, phase: int, *, jumped: bool) -> Fault | None:
        """Take the reading of a tick from the approach on; return the fault of one that loses many frames.

        A time that has `jumped` is told as that, and says nothing of a share.
        """
        last, self._last = self._last, reading
        frame, pads, signals = reading
        if last is None:
            self._image_t_s = frame.t_s
            return None
        # A frame that only comes late is followed by one that comes early.
        missing = round(frame.dt_s / self._period_s) - 1 if isfinite(frame.dt_s) else 0
        self._add(FRAMES, missing, frame.dt_s)
        if pads.counter != last.pads.counter:
            if last.pads.counter:
                self._add("pads", _missing(last.pads, pads), frame.t_s - self._image_t_s)
            self._image_t_s = frame.t_s
        if signals is not last.signals:
            for name, earlier, now in zip(signals._fields, last.signals, signals, strict=True):
                self._add(name, _missing(earlier, now))
        if jumped or phase not in CLOSING:
            return None
        self._frames += 1
        self._expected += frame.dt_s / self._period_s
        self._singly_lost += max(missing, 0)
        return self._many()

    def in_words(self) -> str:
        """Return what was lost, and by how much the result can be off, as a grasp says it; empty if nothing was."""
        if not any(self.lost.values()):
            return ""
        parts = [
            counted(count, "frame") if name == FRAMES else f"{count} of {name}"
            for name, count in self.lost.items()
            if count
        ]
        off = f"; times can be off by {self._longest_s * 1e3:.0f} ms" if self._longest_s else ""
        return f"lost: {', '.join(parts)}{off}"

    def _many(self) -> Fault | None:
        lost = self._expected - self._frames
        if self._expected < FEWEST:
            lost = self._singly_lost
            few = lost < max(SINGLE_GAPS, SINGLE_SHARE * self._expected)
            if self._expected * self._period_s < SLOW_S or few:
                return None
        elif lost < LOST_SHARE * self._expected:
            return None
        return Fault(
            FRAMES_LOST,
            f"{lost / self._expected * 100:.0f} % of the frames are missing, of {1.0 / self._period_s:.4g} a second: "
            "rates and times are less exact; check the connection, the load of this computer and the declared rate",
            ends=lost >= ENDS_SHARE * self._expected,
        )

    def _add(self, name: str, count: int, time_s: float = 0.0) -> None:
        if count > 0 or name in self.lost:
            self.lost[name] = max(self.lost.get(name, 0) + count, 0)
        if count > 0:
            self._longest_s = max(self._longest_s, time_s)


def _missing(earlier: Any, now: Any) -> int:
    """Return the number of images or samples between two values of a channel that were lost."""
    counter = getattr(earlier, "counter", 0)
    if not counter or now.counter == counter:
        return 0
    return max(int(now.counter - counter - (now.new if isinstance(now, Samples) else 1)), 0)
