"""A mean over a recent time."""

from __future__ import annotations

from math import nan


class RecentMean:
    """A mean that forgets: each value counts less by a factor e after `time_s`."""

    def __init__(self, time_s: float) -> None:
        self._time_s, self._seen_s = time_s, 0.0
        self.value = nan

    def add(self, value: float, dt_s: float) -> None:
        """Add a value that held for this time."""
        if not (dt_s > 0.0 and value == value):
            return
        self._seen_s += dt_s
        # The plain mean until the time constant has passed.
        share = dt_s / min(self._seen_s, self._time_s) if self._seen_s > dt_s else 1.0
        self.value = value if share >= 1.0 else self.value + share * (value - self.value)
