"""A gripper that has to be asked for each frame: when it is asked, the rate of its gap, and what did not answer."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from math import nan
from typing import Final, Protocol, TypeVar, final

from graspsense.core.values.signals import Frame

ATTEMPTS: Final = 3
SLOPE_FRAMES: Final = 6
"""Frames over which the rate of the gap is taken."""
ReplyT = TypeVar("ReplyT")


class Clock(Protocol):
    """The time of a device, as the module `time` has that of the host."""

    def monotonic(self) -> float:
        """Return the time (s)."""

    def sleep(self, seconds: float, /) -> None:
        """Let this time pass."""


@final
class Polling:
    """Asks a gripper at multiples of the period of its rate.

    The duration of an exchange does not lower the rate, and lost time is not made up. Its times begin with `begin`,
    which the constructor calls too.
    """

    def __init__(self, rate_hz: float, clock: Clock = time, slope_frames: int = SLOPE_FRAMES) -> None:
        self._period_s, self._clock = 1.0 / rate_hz, clock
        self._gaps: deque[tuple[float, float]] = deque(maxlen=slope_frames)
        self.frames = self.repeated = 0
        self._longest_s = 0.0
        self.begin()

    def begin(self) -> None:
        """Let the time of the frames begin now."""
        self.began_s = self._last_s = self._due_s = self._asked_s = self._clock.monotonic()

    def wait(self, timeout_s: float) -> bool:
        """Wait until the gripper is to be asked, up to this time; return whether it is."""
        wait_s = self._due_s - self._clock.monotonic()
        self._clock.sleep(max(min(wait_s, timeout_s), 0.0))
        if wait_s > timeout_s:
            return False
        self._asked_s = self._clock.monotonic()
        self._due_s = max(self._due_s + self._period_s, self._asked_s)
        return True

    def tried(self, exchange: Callable[[], ReplyT], *no_reply: type[Exception]) -> ReplyT:
        """Return the result of an exchange, which is repeated after `no_reply`. Raises what the last one raises."""
        for _ in range(ATTEMPTS - 1):
            with suppress(*no_reply):
                return exchange()
            self.repeated += 1
        return exchange()

    def told(self, exchange: Callable[[], object], *no_reply: type[Exception]) -> bool:
        """Try an exchange that needs no reply; return whether the connection is there (no OSError)."""
        try:
            with suppress(*no_reply):
                self.tried(exchange, *no_reply, OSError)
        except OSError:
            return False
        return True

    def frame(self, gap_m: float, effort_n: float = nan, status: int = 0) -> Frame:
        """Return the frame of what was asked after `wait` and has come now; the pads have no force."""
        now_s = self._clock.monotonic()
        self._longest_s = max(self._longest_s, now_s - self._asked_s)
        t_s, dt_s, self._last_s = now_s - self.began_s, now_s - self._last_s, now_s
        self._gaps.append((t_s, gap_m))
        start_s, start_m = self._gaps[0]
        velocity = (gap_m - start_m) / (t_s - start_s) if len(self._gaps) > 1 else 0.0
        self.frames += 1
        return Frame(
            t_s=t_s,
            dt_s=dt_s,
            gap_m=gap_m,
            velocity_m_s=velocity,
            effort_n=effort_n,
            status=status,
        )

    def report(self) -> dict[str, float]:
        """Return the number of frames and of repeated exchanges, and how long the longest took until it succeeded."""
        return {
            "frames": self.frames,
            "repeated": self.repeated,
            "frame_uncertainty_s": self._longest_s,
        }
