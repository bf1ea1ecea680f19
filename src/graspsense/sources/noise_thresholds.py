"""Thresholds of contact and rest for recordings of other programs, from the noise of these recordings.

The default thresholds are those of the PR2 gripper. They stay unless the recordings require others: where contact would
be found in the noise, or not in most recordings, or rest never. A time-out that would end a grasp before its recording
does is extended. What is chosen here is the same for all recordings of an import, so that features are comparable.

The noise of a force is its scatter in the first third of the time before it reaches a fifth of its peak. In a recording
that begins in contact, or whose force grows from the beginning, it is that of its second differences, as is the noise
of the gap. Scatter is the median absolute deviation times 1.4826, which is the standard deviation of normal noise; the
second difference of independent noise has sqrt(6) times its standard deviation.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import frozen

from graspsense.core.control.contact import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S, first_rest

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.recording.replayable import Recording

_NORMAL: Final = 1.4826
_FORCE_SIGMAS: Final = 5.0
"""A contact threshold is at least so many standard deviations above the mean force without contact."""
_GAP_SIGMAS: Final = 6.0
_EARLY_SHARE: Final = 0.2
"""Share of the peak force up to which a force counts as without contact."""
_FEW: Final = 5
"""Number of samples that scatter is computed from at least, and that a window of rest has at least."""
_REACHING: Final = 0.75
"""Share of the recordings that must reach the default contact force on both pads, or come to rest, so that it stays."""
_LEAST_FORCE_N, _MOST_FORCE_N = 0.01, 20.0
_SLOW_SHARE: Final = 0.1
"""A rest speed is at most this share of the mean closing speed, so that closing is not taken for rest."""
_MOST_WINDOW_S: Final = 1.0
_MOST_TIMEOUT_S: Final = 600.0
_SOON_M: Final = 0.001
"""Travel within which a contact counts as too wide an object by default, although a recording may begin close to it."""


@frozen(kw_only=True)
class Thresholds:
    """Settings that fit the recordings better than the defaults (`controller.contact_force_n`), and why.

    `settings` is empty where the defaults fit; `words` then says so.
    """

    settings: Mapping[str, float]
    words: str


def thresholds_for(
    recordings: Sequence[Recording], timeouts_s: Mapping[str, float] | None = None
) -> Thresholds:
    """Return the thresholds of contact and rest that these recordings need.

    `timeouts_s` are the time-outs of the controller, by their keys. Recordings that are not in SI units keep the
    defaults.
    """
    in_si = [one for one in recordings if not one.units and len(one.readings) > _FEW]
    if not in_si:
        return Thresholds(settings={}, words="thresholds of contact and rest: the defaults")
    measured = [_Noise.of(one) for one in in_si]
    force, force_words = _contact_force(measured)
    rest, rest_words = _rest(measured)
    contact_n = force.get("controller.contact_force_n", CONTACT_FORCE_N)
    close = sum(_touches_soon(one, contact_n) for one in in_si)
    times, times_words = _timeouts(in_si, timeouts_s or {})
    settings = {**force, **rest, **times, **({"controller.too_wide_m": 0.0} if close else {})}
    if not settings:
        return Thresholds(
            settings={}, words="thresholds of contact and rest: the defaults, which fit the noise"
        )
    close_words = (
        f"too_wide_m 0 m ({close} of {len(in_si)} recordings touch within {_SOON_M * 1e3:g} mm of their beginning)"
        if close
        else ""
    )
    words = "; ".join(filter(None, (force_words, rest_words, times_words, close_words)))
    return Thresholds(settings=settings, words=f"thresholds chosen from the recordings: {words}")


@frozen(kw_only=True)
class _Noise:
    """What one recording says: forces in N, gap in m, times in s."""

    free_force_n: float
    """The largest force that noise without contact explains, over both pads."""
    peak_force_n: float
    """The largest force that both pads reach at the same time."""
    gap_m: float
    """The distance within which a gap at rest stays."""
    step_s: float
    closing_m_s: float

    @classmethod
    def of(cls, recording: Recording) -> _Noise:
        """Measure the noise of a recording."""
        frames = [reading.frame for reading in recording.readings]
        times, gap, left, right = (
            np.array([getattr(frame, name) for frame in frames], dtype=np.float64)
            for name in ("t_s", "gap_m", "force_left_n", "force_right_n")
        )
        both = np.fmin(left, right)
        duration = float(times[-1] - times[0])
        return cls(
            free_force_n=max(_free_force(left), _free_force(right)),
            peak_force_n=float(np.nanmax(both)) if not np.isnan(both).all() else 0.0,
            gap_m=_gap_at_rest(times, gap, both),
            step_s=float(np.median(np.diff(times))),
            closing_m_s=(float(np.nanmax(gap) - np.nanmin(gap)) / duration if duration > 0.0 else 0.0),
        )


def _contact_force(measured: Sequence[_Noise]) -> tuple[dict[str, float], str]:
    """Return the contact threshold if the default does not fit, and why."""
    needed = float(np.quantile([one.free_force_n for one in measured], 0.9))
    peaks = [one.peak_force_n for one in measured]
    if needed <= CONTACT_FORCE_N <= float(np.quantile(peaks, 1.0 - _REACHING, method="lower")):
        return {}, ""
    # Nine of ten recordings must reach the threshold by a factor of two.
    most = 0.5 * float(np.quantile(peaks, 0.1))
    typical = 0.05 * float(np.median(peaks))
    chosen = max(needed, min(typical, most), _LEAST_FORCE_N)
    chosen = min(_rounded_up(chosen), _MOST_FORCE_N)
    doubt = (
        "" if chosen <= 2.0 * most else ", which many recordings hardly reach: check the unit and the zero"
    )
    words = (
        f"contact_force_n {chosen:g} N (without contact the force reaches {needed:.2g} N, and 9 of 10 recordings reach "
        f"{2.0 * most:.2g} N; default {CONTACT_FORCE_N:g} N){doubt}"
    )
    return {"controller.contact_force_n": chosen}, words


def _rest(measured: Sequence[_Noise]) -> tuple[dict[str, float], str]:
    """Return the rest speed and window if the defaults do not fit, and why."""
    travel = float(np.quantile([one.gap_m for one in measured], _REACHING))
    step = float(np.median([one.step_s for one in measured]))
    # Between samples that are further apart than the window, the gap may move for as long as they are apart.
    if travel <= REST_SPEED_M_S * max(REST_WINDOW_S, step):
        return {}, ""
    window = max(REST_WINDOW_S, _rounded_up(_FEW * step)) if _FEW * step > REST_WINDOW_S else REST_WINDOW_S
    slow = max(_SLOW_SHARE * float(np.median([one.closing_m_s for one in measured])), REST_SPEED_M_S)
    if travel > slow * window:
        window = min(_rounded_up(travel / slow), _MOST_WINDOW_S)
    speed = max(_rounded_up(travel / window), REST_SPEED_M_S)
    words = (
        f"rest_speed_m_s {speed:g} m/s within rest_window_s {window:g} s (a gap at rest varies by "
        f"{travel * 1e3:.2g} mm, samples are {step * 1e3:.3g} ms apart; default {REST_SPEED_M_S:g} m/s "
        f"within {REST_WINDOW_S:g} s)"
    )
    return {"controller.rest_speed_m_s": speed, "controller.rest_window_s": window}, words


def _timeouts(
    recordings: Sequence[Recording], timeouts_s: Mapping[str, float]
) -> tuple[dict[str, float], str]:
    """Return the time-outs that are shorter than a recording, extended to the longest one, and why."""
    longest = max(one.readings[-1].frame.t_s - one.readings[0].frame.t_s for one in recordings)
    limit = min(_rounded_up(longest), _MOST_TIMEOUT_S)
    chosen = {f"controller.{key}": limit for key, value in timeouts_s.items() if value < longest}
    if not chosen:
        return {}, ""
    keys = " and ".join(key for key, value in timeouts_s.items() if value < longest)
    return chosen, f"{keys} {limit:g} s (recordings last up to {longest:.3g} s)"


def _touches_soon(recording: Recording, contact_force_n: float) -> bool:
    """Return whether both pads touch after the first sample, but within `_SOON_M` of travel."""
    frames = [reading.frame for reading in recording.readings]
    for k, frame in enumerate(frames):
        if frame.force_left_n >= contact_force_n and frame.force_right_n >= contact_force_n:
            return k > 0 and frames[0].gap_m - frame.gap_m < _SOON_M
    return False


def _free_force(force: NDArray[np.float64]) -> float:
    """Return the largest force that noise without contact explains."""
    known = force[~np.isnan(force)]
    if len(known) <= _FEW:
        return 0.0
    reached = known >= _EARLY_SHARE * known.max()
    early = known[: int(reached.argmax())] if reached.any() else known
    # The last part of a recording that begins close to the object is already a squeeze.
    early = early[: max(len(early) // 3, _FEW)]
    if len(early) < _FEW or _rises(early):
        return _FORCE_SIGMAS * _scatter_of_differences(known)
    middle = float(np.median(early))
    return abs(middle) + _FORCE_SIGMAS * _NORMAL * float(np.median(np.abs(early - middle)))


def _rises(force: NDArray[np.float64]) -> bool:
    """Return whether a force grows by more than its noise explains, so that something is squeezed already."""
    third = max(len(force) // 3, 1)
    growth = float(np.median(force[-third:]) - np.median(force[:third]))
    return growth > _FORCE_SIGMAS * _scatter_of_differences(force)


def _gap_at_rest(times_s: NDArray[np.float64], gap: NDArray[np.float64], force: NDArray[np.float64]) -> float:
    """Return the distance within which a gap at rest stays: its noise, or one step of a coarse encoder.

    It is 0 for an encoder that repeats its numbers, if the default thresholds find the rest of the squeeze: the second
    differences of its steps are motion, not noise.
    """
    known = gap[~np.isnan(gap)]
    if len(known) <= _FEW:
        return 0.0
    steps = np.abs(np.diff(known))
    moved = steps[steps > 0.0]
    if len(moved) < len(steps) and _comes_to_rest(times_s, gap, force):
        return 0.0
    coarse = 1.5 * float(np.median(moved)) if len(moved) and 2 * len(moved) <= len(steps) else 0.0
    return max(_GAP_SIGMAS * _scatter_of_differences(known), coarse)


def _comes_to_rest(
    times_s: NDArray[np.float64], gap: NDArray[np.float64], force: NDArray[np.float64]
) -> bool:
    """Return whether the default thresholds find a rest after the force has risen."""
    loaded = (
        force >= _EARLY_SHARE * np.nanmax(force)
        if not np.isnan(force).all()
        else np.zeros(len(force), np.bool_)
    )
    if not loaded.any():
        return False
    k = int(loaded.argmax())
    shows = np.ones(len(gap) - k, dtype=np.bool_)
    return first_rest(times_s[k:], gap[k:], shows, REST_SPEED_M_S, REST_WINDOW_S) is not None


def _scatter_of_differences(values: NDArray[np.float64]) -> float:
    """Return the standard deviation of the noise of a smooth course, from its second differences."""
    second = np.diff(values, n=2)
    return _NORMAL * float(np.median(np.abs(second - np.median(second)))) / math.sqrt(6.0)


def _rounded_up(value: float) -> float:
    """Return the value with two significant digits, not smaller."""
    if value <= 0.0:
        return 0.0
    digits = 1 - math.floor(math.log10(value))
    return round(math.ceil(round(value * 10.0**digits, 6)) / 10.0**digits, max(digits, 0))
