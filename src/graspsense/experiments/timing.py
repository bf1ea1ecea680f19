"""Durations in words, and an estimate of the remaining time, with its uncertainty."""

from __future__ import annotations

import math
import time
from collections.abc import Callable


def duration_in_words(seconds: float, step_s: int = 1) -> str:
    """Return a duration to one or two digits, seconds in steps: `40 s`, `15 min`, `2.5 h`."""
    if seconds < 100:
        return f"{math.ceil(seconds / step_s) * step_s} s"
    if seconds < 5400:
        return f"{math.ceil(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"


class TimeLeft:
    """The remaining time for `total` tasks, from the durations of those that ended.

    The first task of each worker is left out where others are known: it imports and compiles.
    """

    def __init__(self, total: int, workers: int = 1, clock: Callable[[], float] = time.monotonic) -> None:
        self.total, self.workers = total, workers
        self._seconds: list[float] = []
        self._clock = clock
        self._begun = clock()

    def add(self, seconds: float) -> None:
        """Add the duration of a task that ended."""
        self._seconds.append(seconds)

    @property
    def bounds_s(self) -> tuple[float, float] | None:
        """Two standard errors below and above the estimate; None if there is no estimate yet."""
        remaining = self.total - len(self._seconds)
        known = self._seconds[self.workers :]
        if len(known) < 2:
            return None
        n = len(known)
        mean = sum(known) / n
        spread = math.sqrt(sum((seconds - mean) ** 2 for seconds in known) / (n - 1))
        # Both the mean itself and the tasks to come are uncertain.
        error = spread * math.sqrt(remaining * remaining / n + remaining)
        return max(remaining * mean - 2 * error, 0.0) / self.workers, (
            remaining * mean + 2 * error
        ) / self.workers

    @property
    def words(self) -> str:
        """The estimate in words."""
        bounds = self.bounds_s
        if bounds is None:
            return f"time left not known yet ({duration_in_words(self._clock() - self._begun)} so far)"
        low, high = map(duration_in_words, bounds)
        if bounds[0] < bounds[1] / 10:
            return f"at most {high} left"
        return f"about {low} left" if low == high else f"{low} to {high} left"
