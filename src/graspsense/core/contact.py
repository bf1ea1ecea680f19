"""The two instants a grasp turns on: first contact of both fingers, and coming to rest.

Chitta, Piccoli and Sturm (ICRA 2010), equations 1 and 2, as they must be read: contact is the first time at
which *both* pads are at or above tau_1 (the text; the printed formula has the inequality reversed), and rest is
a speed that *stays* below tau_2 (the printed formula takes a single sample, which noise would end).
Controllers and features share these, so that they never disagree on when a thing was touched or at rest.
"""

from __future__ import annotations

from bisect import bisect_left
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

CONTACT_FORCE_N: Final = 0.625
"""tau_1 on each pad: 1000 counts over the tared zero at 1600 counts/N, as in the authors' code."""
REST_SPEED_M_S: Final = 1e-4
"""tau_2: 0.1 mm/s, as in the authors' code."""
REST_WINDOW_S: Final = 0.05
"""How long the speed must stay below tau_2: one encoder tick in 1 ms alone is 0.33 mm/s on the PR2."""

FEW: Final = 8
"""Samples that are looked at one by one before the rest of them at once."""


class Stillness(NamedTuple):
    """Since when, and where, the gap has stood still."""

    since_t_s: float
    gap_m: float


def both_touch(force_left_n: float, force_right_n: float, contact_force_n: float) -> bool:
    """Return whether both pads are at or above the contact force (equation 1). NaN never touches."""
    return force_left_n >= contact_force_n and force_right_n >= contact_force_n


def watch(
    still: Stillness, t_s: float, gap_m: float, rest_speed_m_s: float, rest_window_s: float
) -> Stillness:
    """Return the stillness after one more sample: unchanged, or begun anew where the gap has moved on.

    The gap may stray from where the stillness began by the rest speed times the window; on a clock slower than
    the window, by the rest speed times the time elapsed. A gap that is NaN is never still.
    """
    allowed_m = rest_speed_m_s * max(rest_window_s, t_s - still.since_t_s)
    if abs(gap_m - still.gap_m) <= allowed_m:
        return still
    return Stillness(t_s, gap_m)


def at_rest(still: Stillness, t_s: float, rest_window_s: float) -> bool:
    """Return whether the stillness has lasted the window (equation 2); rest then began at `still.since_t_s`."""
    # Half a nanosecond of grace: sums of ticks of 1 ms fall short of 50 ms by rounding.
    return t_s - still.since_t_s >= rest_window_s - 5e-10


def first_rest(
    times_s: NDArray[np.float64],
    gaps_m: NDArray[np.float64],
    shows: NDArray[np.bool_],
    rest_speed_m_s: float,
    rest_window_s: float,
) -> tuple[int, int] | None:
    """Return the sample at which rest begins and the first that shows it, or None.

    It is what `watch` and `at_rest` say sample by sample. `shows` tells which samples may show a rest.
    """
    import numpy as np

    n = len(times_s)
    if n == 0:
        return None
    # Where the very next sample has moved on, and one alone is no rest, there is nothing to look at.
    lasting = np.ones(n, bool)
    if not at_rest(Stillness(times_s[0], gaps_m[0]), times_s[0], rest_window_s):
        allowed = rest_speed_m_s * np.maximum(rest_window_s, times_s[1:] - times_s[:-1])
        np.less_equal(np.abs(gaps_m[1:] - gaps_m[:-1]), allowed, out=lasting[:-1])
    skipped = int(lasting.argmax())
    begins = np.flatnonzero(lasting[skipped:]).tolist()
    times, gaps = times_s[skipped:].tolist(), gaps_m[skipped:].tolist()
    n -= skipped
    at_once_m = rest_speed_m_s * rest_window_s
    end = following = 0
    while end < n:
        while begins[following] < end:
            following += 1
        since = begins[following]
        still = Stillness(times[since], gaps[since])
        # While it moves most stillnesses are short, so the first samples are looked at one by one, as `watch` does.
        few = min(since + FEW, n)
        end, at_m, since_s = since, still.gap_m, still.since_t_s
        if times[few - 1] - since_s <= rest_window_s:
            while end < few and abs(gaps[end] - at_m) <= at_once_m:
                end += 1
        else:
            while end < few and watch(still, times[end], gaps[end], rest_speed_m_s, rest_window_s) is still:
                end += 1
        if end == few:
            begin = skipped + few
            allowed = rest_speed_m_s * np.maximum(rest_window_s, times_s[begin:] - still.since_t_s)
            strayed = ~(np.abs(gaps_m[begin:] - still.gap_m) <= allowed)
            end = few + int(strayed.argmax()) if strayed.any() else n
        if end > since and at_rest(still, times[end - 1], rest_window_s):
            # From just before the window is full, for what is left is a matter of rounding.
            full = bisect_left(times, still.since_t_s + rest_window_s - 1e-9, since, end)
            while not at_rest(still, times[full], rest_window_s):
                full += 1
            showing = shows[skipped + full : skipped + end]
            if showing.any():
                return skipped + since, skipped + full + int(showing.argmax())
        end = max(end, since + 1)
    return None
