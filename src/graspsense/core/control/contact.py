"""The two instants that define a grasp: first contact of both fingers, and rest.

These are equations 1 and 2 of Chitta, Piccoli and Sturm (ICRA 2010) with two corrections. Contact is the first time at
which *both* pads are at or above tau_1, as the text says; the printed formula has the inequality reversed. Rest is a
gap that *stays*, over a window, within what tau_2 would move it in that window; the printed formula takes the speed
of a single sample, which noise would pass.
Controllers and features share these functions, so that they agree on contact, and on the rest of a gap without noise.
In noise, a rest that was recorded is not begun anew (`follow_rest`), while a controller waits until one shows.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

CONTACT_FORCE_N: Final = 0.625
"""Contact threshold tau_1 of each pad: 1000 counts above the tared zero at 1600 counts/N, as in the authors' code."""
REST_SPEED_M_S: Final = 1e-4
"""Rest threshold tau_2: 0.1 mm/s, as in the authors' code."""
REST_WINDOW_S: Final = 0.05
"""Time for which the speed must stay below tau_2. One encoder tick in 1 ms is already 0.33 mm/s on the PR2."""
AWAY: Final = 0.2
"""Share of the window within which a gap that comes back has not moved: noise takes it away for less."""
MOVED_M: Final = 1e-3
"""Travel after which the fingers have overcome static friction: fingers that stand still later have met something."""


class RestState(NamedTuple):
    """The time since which the gap has been at rest (s), and its value then (m).

    A control law keeps one in its state and begins with `RestState(0.0, 0.0)`.
    """

    since_t_s: float
    gap_m: float


def both_touch(force_left_n: float, force_right_n: float, contact_force_n: float) -> bool:
    """Return whether both pads are at or above the contact force (N, equation 1). NaN counts as no contact.

    >>> both_touch(0.8, 0.7, CONTACT_FORCE_N), both_touch(0.8, 0.1, CONTACT_FORCE_N)
    (True, False)
    """
    return force_left_n >= contact_force_n and force_right_n >= contact_force_n


def either_touches(force_left_n: float, force_right_n: float, contact_force_n: float) -> bool:
    """Return whether at least one pad is at or above the contact force (N). NaN counts as no contact.

    >>> either_touches(0.8, 0.1, CONTACT_FORCE_N), either_touches(0.1, 0.1, CONTACT_FORCE_N)
    (True, False)
    """
    return force_left_n >= contact_force_n or force_right_n >= contact_force_n


def update_rest(
    still: RestState, t_s: float, gap_m: float, rest_speed_m_s: float, rest_window_s: float
) -> RestState:
    """Return the state after one more sample: unchanged, or starting at this sample if the gap has moved.

    Call it in every tick with the time (s) and the gap (m) of the frame, the speed below which the fingers are at
    rest (m/s), and the time for which they must be at rest (s). The gap may differ from the value in the state by the
    rest speed times the window, or, if samples are further apart than the window, by the rest speed
    times the elapsed time. A gap of NaN is never at rest.

    >>> still = RestState(since_t_s=1.0, gap_m=0.05)
    >>> update_rest(still, 1.02, 0.05, REST_SPEED_M_S, REST_WINDOW_S)
    RestState(since_t_s=1.0, gap_m=0.05)
    >>> update_rest(still, 1.02, 0.049, REST_SPEED_M_S, REST_WINDOW_S)
    RestState(since_t_s=1.02, gap_m=0.049)
    """
    allowed_m = rest_speed_m_s * max(rest_window_s, t_s - still.since_t_s)
    if abs(gap_m - still.gap_m) <= allowed_m:
        return still
    return RestState(t_s, gap_m)


def at_rest(still: RestState, t_s: float, rest_window_s: float) -> bool:
    """Return whether the gap has been at rest for the window (s) at time `t_s` (equation 2).

    Rest then began at `still.since_t_s`.

    >>> still = RestState(since_t_s=1.0, gap_m=0.05)
    >>> at_rest(still, 1.02, REST_WINDOW_S), at_rest(still, 1.06, REST_WINDOW_S)
    (False, True)
    """
    # The tolerance of half a nanosecond covers the rounding of sums of 1 ms ticks.
    return t_s - still.since_t_s >= rest_window_s - 5e-10


class RestCourse(NamedTuple):
    """The rest of a recorded gap, as `RestState`, and the one that the gap has left, with the time (s) of that.

    It begins with NaN for what was left:

    >>> RestCourse(1.0, 0.05, math.nan, math.nan, math.nan).since_t_s
    1.0
    """

    since_t_s: float
    gap_m: float
    left_since_t_s: float
    left_gap_m: float
    left_t_s: float


def follow_rest(
    course: RestCourse, t_s: float, gap_m: float, rest_speed_m_s: float, rest_window_s: float
) -> RestCourse:
    """Return the course after one more sample: by `update_rest`, but a gap that comes back soon had not moved.

    So noise does not begin a rest anew. A gap that closes without noise never comes back, and rests as `update_rest`
    says; so does one that was no number.

    >>> left = RestCourse(1.03, 0.049, 1.0, 0.05, 1.03)
    >>> back = follow_rest(left, 1.031, 0.05, REST_SPEED_M_S, REST_WINDOW_S)
    >>> back.since_t_s, back.gap_m
    (1.0, 0.05)
    """
    since, gap, left_since, left_gap, left = course
    away = t_s - left <= AWAY * rest_window_s
    if away and abs(gap_m - left_gap) <= rest_speed_m_s * max(rest_window_s, left - left_since):
        since, gap, left = left_since, left_gap, math.nan
    else:
        still = update_rest(RestState(since, gap), t_s, gap_m, rest_speed_m_s, rest_window_s)
        if still.since_t_s != since:
            if not away:
                left_since, left_gap, left = since, gap, t_s
            since, gap = still
    if gap_m != gap_m:
        left = math.nan
    return RestCourse(
        since_t_s=since, gap_m=gap, left_since_t_s=left_since, left_gap_m=left_gap, left_t_s=left
    )


def first_rest(
    times_s: NDArray[np.float64],
    gaps_m: NDArray[np.float64],
    shows: NDArray[np.bool_],
    rest_speed_m_s: float,
    rest_window_s: float,
) -> tuple[int, int] | None:
    """Return the index of the sample at which rest begins and that of the first that shows it, or None.

    Arrays of shape (n,). Only samples in `shows` can show a rest. The result is that of `follow_rest` and `at_rest`.

    >>> times, gaps, shows = np.arange(11) * 0.01, np.array([0.06, 0.055] + [0.05] * 9), np.ones(11, bool)
    >>> first_rest(times, gaps, shows, REST_SPEED_M_S, REST_WINDOW_S)
    (2, 7)
    """
    nan = math.nan
    course = RestCourse(since_t_s=nan, gap_m=nan, left_since_t_s=nan, left_gap_m=nan, left_t_s=nan)
    for i, (t_s, gap_m, showing) in enumerate(
        zip(times_s.tolist(), gaps_m.tolist(), shows.tolist(), strict=True)
    ):
        course = follow_rest(course, t_s, gap_m, rest_speed_m_s, rest_window_s)
        if showing and at_rest(RestState(course.since_t_s, course.gap_m), t_s, rest_window_s):
            return int(times_s[: i + 1].searchsorted(course.since_t_s)), i
    return None
