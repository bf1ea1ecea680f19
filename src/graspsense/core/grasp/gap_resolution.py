"""How finely a gap was measured: its least step, and how often it is measured.

A coarse encoder repeats a number while the fingers move, and so does a gap that is measured less often than its rows
are written. Neither is a rest. The window in which a rest shows follows from both: a speed below tau_2 needs the time
of a step at this speed, and a gap that was measured three times.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

ROUNDING: Final = 1e-9
"""Share of a gap up to which a change is one of rounding."""
MARGIN: Final = 1.05
"""Factor on the time of a step, so that a step within the window is not motion because of rounding."""
HELD: Final = 1.5
"""Rows between two changes of a gap in the approach from which on it is measured less often than its rows."""
MEASURED: Final = 3.0
"""Number of times that a gap is measured in a window."""
LEAST_CHANGES: Final = 3


class GapResolution(NamedTuple):
    """The least step of a coarse gap (m), and the time between its measurements if rows repeat it (s); else 0."""

    step_m: float
    period_s: float


def window_of_rest(resolution: GapResolution, rest_speed_m_s: float, rest_window_s: float) -> float:
    """Return the window (s) in which a rest below this speed (m/s) shows: not shorter than `rest_window_s`.

    >>> window_of_rest(GapResolution(1e-4, 0.0), 2e-4, 0.05)
    0.525
    """
    return max(rest_window_s, MARGIN * resolution.step_m / rest_speed_m_s, MEASURED * resolution.period_s)


def gap_resolution(times_s: Sequence[float], gaps_m: Sequence[float], contact: int) -> GapResolution:
    """Return the resolution of the gap of a grasp with its first contact at this sample.

    `times_s` (s) and `gaps_m` (m) are of one length; in the interpreter, lists take less time than arrays. The gap is
    coarse if it repeats a number while it closes. Then its least change is its step.

    >>> times, coarse = [0.1 * i for i in range(100)], [round(0.06 - 4e-5 * i, 4) for i in range(100)]
    >>> round(gap_resolution(times, coarse, 0).step_m, 9)
    0.0001
    """
    end = len(gaps_m)
    first_change, last_change = 1, contact
    while first_change < end and not _changes(gaps_m[first_change - 1], gaps_m[first_change]):
        first_change += 1
    while last_change > first_change and not _changes(gaps_m[last_change - 1], gaps_m[last_change]):
        last_change -= 1
    n_changes = _count_changes(gaps_m[first_change - 1 : last_change], gaps_m[first_change : last_change + 1])
    period_s = 0.0
    if n_changes >= LEAST_CHANGES and last_change - first_change > HELD * (n_changes - 1):
        period_s = (times_s[last_change] - times_s[first_change]) / (n_changes - 1)
    # An approach in which each sample is a change has no repeated number.
    begin = last_change if n_changes == last_change - first_change + 1 else first_change
    if not _repeats_while_closing(gaps_m, begin, end):
        return GapResolution(0.0, period_s)
    step_m = abs(gaps_m[first_change] - gaps_m[first_change - 1])
    for i in range(first_change, end):
        if _changes(gaps_m[i - 1], gaps_m[i]):
            step_m = min(step_m, abs(gaps_m[i] - gaps_m[i - 1]))
    return GapResolution(step_m, period_s)


def _changes(previous_m: float, gap_m: float) -> bool:
    return abs(gap_m - previous_m) > ROUNDING * abs(gap_m)


def _count_changes(previous_m: Sequence[float], gaps_m: Sequence[float]) -> int:
    """Return how many gaps differ from those before them."""
    n = 0
    for i in range(len(gaps_m)):
        n += 1 if _changes(previous_m[i], gaps_m[i]) else 0
    return n


def _repeats_while_closing(gaps_m: Sequence[float], begin: int, end: int) -> bool:
    """Return whether a number is repeated between two changes that close the gap."""
    last_change, was_closing = end, False
    for i in range(begin, end):
        if _changes(gaps_m[i - 1], gaps_m[i]):
            closing = gaps_m[i] < gaps_m[i - 1]
            if i - last_change > 1 and closing and was_closing:
                return True
            last_change, was_closing = i, closing
    return False
