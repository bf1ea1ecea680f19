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
    first_change, last_change, n_changes = 0, 0, 0
    changed, closing, repeats, step_m = 0, False, False, 0.0
    gap_m = gaps_m[0]
    for i in range(1, len(gaps_m)):
        previous_m, gap_m = gap_m, gaps_m[i]
        change_m = abs(gap_m - previous_m)
        if change_m > ROUNDING * abs(gap_m):
            if changed == 0:
                first_change, step_m = i, change_m
            elif i - changed > 1 and closing and gap_m < previous_m:
                repeats = True
            if change_m < step_m:
                step_m = change_m
            if i <= contact:
                last_change, n_changes = i, n_changes + 1
            changed, closing = i, gap_m < previous_m
    period_s = 0.0
    if n_changes >= LEAST_CHANGES and last_change - first_change > HELD * (n_changes - 1):
        period_s = (times_s[last_change] - times_s[first_change]) / (n_changes - 1)
    return GapResolution(step_m if repeats else 0.0, period_s)
