"""The time at which the messages of a grasp are logged: in recordings, and by what shows it while it goes on."""

from __future__ import annotations

from typing import Final

_LAST_NS: Final = 2**64 - 1
"""The last time that a message can have, in the year 2554."""


class LogClock:
    """Gives the gripper's time plus `base_ns`, the wall-clock time in nanoseconds at time 0 of the gripper's clock.

    If `base_ns` is None, it is taken from the first message.
    """

    def __init__(self, base_ns: int | None = None) -> None:
        self._base_ns = base_ns

    def log_ns(self, t_s: float, now_ns: int) -> int:
        """Return the time to log a message at that is of the gripper's time `t_s` and has come at `now_ns`."""
        if self._base_ns is None:
            self._base_ns = now_ns - _ns(t_s)
        return min(max(0, self._base_ns + _ns(t_s)), _LAST_NS)


def _ns(t_s: float) -> int:
    return round(t_s * 1e9) if abs(t_s) < 1e9 else 0
