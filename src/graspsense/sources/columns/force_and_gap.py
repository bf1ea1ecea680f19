"""Whether the force and the gap of a recording belong together, where the clocks of their topics leave it open.

The fingers slow down when they meet the object, which is when the force begins. A soft object, or a slow approach,
shows no such moment; then nothing in the recording tells a slow topic from a clock that is off.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from graspsense.sources.columns.channel_facts import period_s, usual_range
from graspsense.sources.formats.table import Numbers

LEAST_S: Final = 0.015
"""Delays of two topics that differ by less (s) are usual."""
LOADED: Final = 0.2
"""Share of its range above which a force is no noise."""
APPROACH_S: Final = (0.25, 0.06)
"""Begin and end of the approach, before the force begins (s)."""
FEWEST: Final = 5
"""Fewest samples of the approach."""
LAGS_S: Final = 0.005
NOISE: Final = 5.0
"""The fingers slow down where they are so late (s), and by so many times the noise of their gap. The force begins
where it is above what it was by so many times its own noise."""


def doubtful_delay(t_s: Numbers, gap: Numbers, force: Numbers, later_s: float) -> str:
    """Return a sentence if gap and force may be apart in time by `later_s`, and no sign tells that they are not.

    `later_s` is how much later the messages of the force are recorded, after the time in their headers, than those of
    the gap: the force is slow, or the clock in one of the headers is off by this time.
    """
    if not abs(later_s) > LEAST_S:
        return ""
    known = np.isfinite(t_s) & np.isfinite(gap) & np.isfinite(force)
    apart_s = _slows_after_force(t_s[known], gap[known], force[known])
    if apart_s is not None and max(abs(apart_s), period_s(t_s[known], force[known])) < 0.5 * abs(later_s):
        return ""
    older, newer = ("force", "gap") if later_s > 0.0 else ("gap", "force")
    return (
        f"the headers of the {older} are {abs(later_s) * 1e3:.0f} ms older than those of the {newer} when their "
        "messages are recorded: its topic is slow, or a clock is off, and then gap and force do not belong together"
    )


def _slows_after_force(t_s: Numbers, gap: Numbers, force: Numbers) -> float | None:
    """Return how long after the begin of the force (s) the fingers slow down; None where they do not, or too rarely."""
    if not len(t_s):
        return None
    low, high = usual_range(force)
    loaded = int(np.argmax(force > low + LOADED * (high - low)))
    # The rows can be more than the values of a signal.
    newer, new = (np.concatenate(([True], np.diff(signal) != 0.0)) for signal in (force, gap))
    bends = np.abs(np.diff(force[newer], 2))
    noise = NOISE * float(np.median(bends)) if len(bends) else 0.0
    free = np.flatnonzero(force[:loaded] < float(np.median(force[: loaded // 2 + 1])) + noise)
    if not len(free):
        return None
    begun_s = float(t_s[free[-1] + 1])
    times, values = t_s[new] - begun_s, gap[new]
    approach = (times > -APPROACH_S[0]) & (times < -APPROACH_S[1])
    if approach.sum() < FEWEST:
        return None
    course = np.polyfit(times[approach], values[approach], 1)
    late = values - np.polyval(course, times)
    least = max(-float(course[0]) * LAGS_S, NOISE * float(np.std(late[approach])))
    on_course = np.flatnonzero((late <= least) & (times > -APPROACH_S[0]))
    if course[0] >= 0.0 or not len(on_course) or on_course[-1] + 1 == len(times):
        return None
    return float(times[on_course[-1] + 1])
