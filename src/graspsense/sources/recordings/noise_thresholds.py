"""Thresholds of contact and rest for recordings of other programs, from these recordings.

The default thresholds are those of the PR2 gripper, in SI units. They stay unless the recordings require others: where
contact would be found in the noise, or not in most recordings, or rest never, or where the gap is too coarse for them.
A recording in another unit, such as counts, has no defaults. A time-out that would end a grasp before its recording
does is extended. What is chosen here is the same for all recordings of an import, so that features are comparable.

The noise of a force is its scatter in the first third of the time before it reaches a fifth of its peak. In a recording
that begins in contact, or whose force grows from the beginning, it is that of its second differences, as is the noise
of the gap. Scatter is the median absolute deviation times 1.4826, which is the standard deviation of normal noise; the
second difference of independent noise has sqrt(6) times its standard deviation.

A force without a known zero, where the noise so measured is above what most recordings reach, is that of recordings
which begin in contact: nothing in them is without contact, so the contact force is below all that they begin with.

The window of rest is the time in which the rest speed makes the least step that the gap shows. If most recordings do
not hold so long, the speed is raised until they do, at most to a quarter of the speed of the squeeze.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import frozen

from graspsense.core.control.contact import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S, first_rest
from graspsense.core.grasp.gap_resolution import MARGIN, MEASURED, gap_resolution
from graspsense.core.values.signals import NO_GAP
from graspsense.recording.replayable import Recording
from graspsense.sources.formats.table import Numbers

if TYPE_CHECKING:
    from graspsense.core.settings.resolved import Settings

THRESHOLDS: Final[tuple[str, ...]] = ("contact_force_n", "rest_speed_m_s", "rest_window_s")
"""The settings of controllers and features that are chosen here, and that a user may give instead."""
TIMEOUTS: Final = ("move_timeout_s", "steady_timeout_s")
"""Settings of a controller that would end a grasp before its recording does."""
SAMPLE: Final = "sample"
"""The unit of time of a recording without a clock."""
_NORMAL: Final = 1.4826
_FORCE_SIGMAS: Final = 5.0
"""A contact threshold is at least so many standard deviations above the mean force without contact."""
_GAP_SIGMAS: Final = 4.0
"""A gap at rest leaves the value that it began at by more than so many standard deviations for a moment only."""
_EARLY_SHARE: Final = 0.2
"""Share of the peak force up to which a force counts as without contact."""
_FEW: Final = 5
"""Number of samples that scatter is computed from at least, and that a window of rest has at least in noise."""
_HELD: Final = 0.75
"""Share of the force in a window of rest below which the force at its end is that of a release."""
_PRESSED: Final = 0.9
"""Share of the peak force from which on a gap is nearly at rest."""
_REACHING: Final = 0.75
"""Share of the recordings that must reach the default contact force on both pads, or come to rest, so that it stays."""
_LEAST_FORCE_N, _MOST_FORCE_N = 0.01, 20.0
_TYPICAL: Final = 0.05
"""Share of the peak force at which contact is where no default fits."""
_SLOW_SHARE, _SQUEEZE_SHARE = 0.1, 0.25
"""A rest speed is at most the second share of the speed of the squeeze, which must not be taken for rest; where it is
not known, the first share of the mean speed."""
_STILL_SHARE: Final = 0.01
"""The rest speed as a share of the speed of closing, where the gap is not in metres."""
_FASTER: Final = 1.5
"""Factor from one rest speed that is tried to the next."""
_MOST_WINDOW_S: Final = 5.0
_MOST_TIMEOUT_S: Final = 600.0
_SOON_M: Final = 0.001
"""Travel within which a contact counts as too wide an object by default, although a recording may begin close to it."""
_CLOSED_M: Final = 0.003
"""Gap at which the fingers count as closed by default, although an object can be thinner."""
_CRUSH_SHARE: Final = 0.025
"""Travel of a crush as a share of the range of the gap, where it is not in metres: 2 of 80 mm by default."""
_SLIP_SHARE: Final = 0.05
"""Time of a slip as a share of the duration, where time is not in seconds."""
_MOST_TRIED: Final = 200
"""Number of recordings on which a rest speed is tried."""


@frozen(kw_only=True)
class Thresholds:
    """Settings that fit the recordings better than the defaults (`controller.contact_force_n`), and why.

    `settings` is empty where the defaults fit; `words` then says so.
    """

    settings: Mapping[str, float]
    words: str

    @property
    def options(self) -> tuple[str, ...]:
        """The settings as options of a command: `controller.contact_force_n=0.3`."""
        return tuple(f"{key}={self.settings[key]!r}" for key in sorted(self.settings))


def open_thresholds(settings: Settings, recordings: Sequence[Recording]) -> Thresholds:
    """Return the thresholds that these recordings need, of the keys of the controller that nobody has set."""
    controller = settings.values.get("controller", {})
    is_open = {key for key in controller if settings.origins.get(f"controller.{key}") == "default"}
    timeouts_s: dict[str, float] = {key: controller[key] for key in TIMEOUTS if key in controller}
    given: dict[str, float] = {
        key: controller[key] for key in THRESHOLDS if key in controller and key not in is_open
    }
    needed = thresholds_for(recordings, timeouts_s, given)
    chosen = {key: value for key, value in needed.settings.items() if key.partition(".")[2] in is_open}
    words = needed.words if chosen or not needed.settings else "thresholds: those that are given"
    return Thresholds(settings=chosen, words=words)


def thresholds_for(
    recordings: Sequence[Recording],
    timeouts_s: Mapping[str, float] | None = None,
    given: Mapping[str, float] | None = None,
) -> Thresholds:
    """Return the thresholds of contact and rest that these recordings need.

    `timeouts_s` are the time-outs of the controller, and `given` the thresholds that a user gave, by their keys.
    Recordings in other units than most are left out; those of a data set that counts time in frames, whose metres and
    newtons are nominal, keep the defaults.
    """
    long_enough = [recording for recording in recordings if len(recording.readings) > _FEW]
    counts = Counter(tuple(sorted(recording.units.items())) for recording in long_enough)
    units = max(counts, key=counts.__getitem__, default=())
    used = [recording for recording in long_enough if tuple(sorted(recording.units.items())) == units]
    scale = _Scale.in_units(dict(units))
    if not used or scale.is_nominal:
        return Thresholds(settings={}, words="thresholds of contact and rest: the defaults")
    measured = [_Noise.measured_in(recording, scale) for recording in used]
    force, force_words = _contact_force(measured, scale)
    contact = (given or {}).get("contact_force_n", force.get("controller.contact_force_n", CONTACT_FORCE_N))
    resting, rest_words = _rest(measured, scale, contact, given or {})
    times, times_words = _timeouts(used, timeouts_s or {}, scale)
    ends, ends_words = _ends(measured, scale, contact)
    settings, seen = {**force, **resting, **times, **ends}, _seen(measured, scale)
    if not settings:
        defaults = (
            f"contact {CONTACT_FORCE_N:g} N, rest below {REST_SPEED_M_S:g} m/s within {REST_WINDOW_S:g} s"
        )
        words = f"thresholds of contact and rest: the defaults, which fit the noise ({defaults}{seen})"
        return Thresholds(settings={}, words=words)
    words = "; ".join(filter(None, (force_words, rest_words, times_words, ends_words)))
    return Thresholds(settings=settings, words=f"thresholds chosen from the recordings: {words}{seen}")


@frozen
class _Scale:
    """The units of the recordings: `N`, `m` and `s`, or others."""

    force: str
    gap: str
    t: str

    @classmethod
    def in_units(cls, units: Mapping[str, str]) -> _Scale:
        return cls(units.get("force_left", "N"), units.get("gap", "m"), units.get("t", "s"))

    @property
    def is_nominal(self) -> bool:
        """Whether force and gap are in SI units, but time is counted by a data set."""
        return (self.force, self.gap) == ("N", "m") and self.t not in ("s", SAMPLE)

    @property
    def speed(self) -> str:
        return f"{self.gap}/{self.t}"

    @property
    def has_rest(self) -> bool:
        """Whether the default thresholds of rest have a meaning."""
        return (self.gap, self.t) == ("m", "s")


@frozen(eq=False)
class _Noise:
    """What one recording says, in its own units: times, gap, and the forces of both pads."""

    times: Numbers
    gap: Numbers
    pads: tuple[Numbers, Numbers]
    baseline: float
    """The force without contact."""

    @classmethod
    def measured_in(cls, recording: Recording, scale: _Scale) -> _Noise:
        """Return what there is to measure in a recording."""
        times, gap, left, right = recording.columns("t_s", "gap_m", "force_left_n", "force_right_n")
        return cls(times, gap, (left, right), 0.0 if scale.force == "N" else _baseline(np.fmin(left, right)))

    @cached_property
    def both(self) -> Numbers:
        """The force that both pads feel."""
        both: Numbers = np.fmin(*self.pads)
        return both

    @cached_property
    def peak_force(self) -> float:
        """The largest force that both pads reach at the same time; 0 if none is known."""
        return float(np.fmax.reduce(self.both, initial=np.nan) if np.isfinite(self.both).any() else 0.0)

    @property
    def loaded(self) -> int:
        """The first sample with a fifth of the peak force."""
        return int((self.both >= self.baseline + _EARLY_SHARE * (self.peak_force - self.baseline)).argmax())

    @property
    def free_force(self) -> float:
        """The largest force that noise without contact explains, over both pads."""
        return max(_free_force(pad, self.baseline) for pad in self.pads)

    @property
    def noise(self) -> float:
        """The distance within which a gap at rest stays by its noise, which shows best where the force is large."""
        known = np.isfinite(self.gap)
        pressed = known & (self.both >= _PRESSED * self.peak_force)
        known = pressed if np.count_nonzero(pressed) > 2 * _FEW else known
        return (
            _GAP_SIGMAS * _scatter_of_differences(self.gap[known]) if np.count_nonzero(known) > _FEW else 0.0
        )

    @cached_property
    def steps(self) -> tuple[float, float, float]:
        """The least step of a coarse gap, the time between its measurements if rows repeat it, and between samples."""
        resolution = gap_resolution(self.times.tolist(), self.gap.tolist(), self.loaded)
        return resolution.step_m, resolution.period_s, float(np.median(np.diff(self.times)))

    @property
    def closing(self) -> float:
        """The mean speed of the whole recording."""
        duration = float(self.times[-1] - self.times[0])
        return (
            float(np.fmax.reduce(self.gap) - np.fmin.reduce(self.gap)) / duration if duration > 0.0 else 0.0
        )

    @property
    def squeezing(self) -> float:
        """The mean speed of the gap from a fifth of the peak force to 95 % of it; 0 if it does not close."""
        begin, top = self.loaded, int((self.both >= 0.95 * self.peak_force).argmax())
        closed = float(self.gap[begin] - self.gap[top])
        return closed / float(self.times[top] - self.times[begin]) if top > begin and closed > 0.0 else 0.0

    def travel(self, contact: float) -> float:
        """Return how far the gap has closed when both pads touch; infinite if never, or from the first sample on."""
        k = int((self.both >= contact).argmax())
        return float(self.gap[0] - self.gap[k]) if k else math.inf

    def rests(self, contact: float, speed: float, window: float) -> bool:
        """Return whether it comes to rest after both pads have touched, and still presses where that shows."""
        touched = np.flatnonzero(self.both >= contact)
        if not len(touched):
            return False
        k = int(touched[0])
        shows = (self.both[k:] >= contact) | ~(self.gap[k:] > self.gap[k] + speed * window)
        resting = first_rest(self.times[k:], self.gap[k:], shows, speed, window)
        if resting is None:
            return False
        since, shown = resting
        force = self.both[k + since : k + shown + 1]
        return bool(force[-1] > _HELD * np.median(force))


def _contact_force(measured: Sequence[_Noise], scale: _Scale) -> tuple[dict[str, float], str]:
    """Return the contact threshold if the default does not fit, and why."""
    si = scale.force == "N"
    base = float(np.median([noise.baseline for noise in measured]))
    needed = float(np.quantile([noise.free_force for noise in measured], 0.9))
    peaks = [noise.peak_force for noise in measured]
    if si and needed <= CONTACT_FORCE_N <= float(np.quantile(peaks, 1.0 - _REACHING, method="lower")):
        return {}, ""
    # Nine of ten recordings must reach the threshold by a factor of two.
    reached = float(np.quantile(peaks, 0.1)) - base
    most = 0.5 * reached
    typical = _TYPICAL * (float(np.median(peaks)) - base)
    above = max(needed - base, min(typical, most), _LEAST_FORCE_N if si else 0.0)
    chosen = base + (min(_rounded(above), _MOST_FORCE_N) if si else _rounded(above))
    if not si and chosen > float(np.quantile(peaks, 1.0 - _REACHING, method="lower")):
        chosen = max(_rounded(min(noise.baseline for noise in measured), math.floor), _LEAST_FORCE_N)
        return {"controller.contact_force_n": chosen}, (
            f"contact_force_n {chosen:g} {scale.force}, so that recordings are in contact from the beginning (their "
            "forces at the beginning differ by more than they grow later; if the fingers were free then, write zero)"
        )
    if chosen <= 0.0:  # a force below zero throughout
        chosen = _LEAST_FORCE_N
    doubt = "" if above <= 2.0 * most else ", which many recordings hardly reach: check the unit and the zero"
    default = f"default {CONTACT_FORCE_N:g} N" if si else f"there is no default in {scale.force}"
    words = (
        f"contact_force_n {chosen:g} {scale.force} (without contact the force reaches {needed:.2g} {scale.force}, and "
        f"9 of 10 recordings reach {reached + base:.2g} {scale.force}; {default}){doubt}"
    )
    return {"controller.contact_force_n": chosen}, words


def _rest(
    measured: Sequence[_Noise], scale: _Scale, contact: float, given: Mapping[str, float]
) -> tuple[dict[str, float], str]:
    """Return the rest speed and window if the defaults do not fit, and why."""
    noise = float(np.quantile([noise_.noise for noise_ in measured], _REACHING))
    step, period, sampled = _steps(measured)
    closing = float(np.median([recording.closing for recording in measured]))
    squeezing = [recording.squeezing for recording in measured if recording.squeezing > 0.0]
    slowest = _SQUEEZE_SHARE * float(np.median(squeezing)) if squeezing else _SLOW_SHARE * closing
    default_speed = REST_SPEED_M_S if scale.has_rest else _STILL_SHARE * closing
    default_window = max(
        REST_WINDOW_S if scale.t == "s" else 0.0, 0.0 if scale.has_rest else MEASURED * sampled
    )
    if not default_speed > 0.0:  # the gap does not move, or there is none
        longest = max(float(recording.times[-1] - recording.times[0]) for recording in measured)
        return ({} if scale.has_rest else {"controller.rest_window_s": _rounded(2.0 * longest)}), ""
    travel = max(noise, MARGIN * step)
    # Between samples that are further apart than the window, the gap may move for as long as they are apart.
    fits = travel <= default_speed * max(default_window, sampled) and MEASURED * period <= default_window
    if scale.has_rest and fits:
        return {}, ""
    least = max(default_window, MEASURED * period, _FEW * sampled if noise and not step else 0.0)
    speed = given.get("rest_speed_m_s", default_speed)
    if "rest_window_s" in given:
        least = given["rest_window_s"]
        speed = max(speed, travel / least)
    tried = measured[:: math.ceil(len(measured) / _MOST_TRIED)]
    candidates = [speed]
    is_open = not given.keys() & {"rest_speed_m_s", "rest_window_s"}
    while is_open and candidates[-1] * _FASTER <= max(slowest, speed):
        candidates.append(candidates[-1] * _FASTER)
    pairs = [(v, _window(travel / v, least, scale)) for v in map(_rounded, candidates)]
    resting = [sum(recording.rests(contact, *pair) for recording in tried) for pair in pairs]
    enough = _REACHING * sum(bool((recording.both >= contact).any()) for recording in tried)
    chosen = next((k for k, count in enumerate(resting) if count >= enough), int(np.argmax(resting)))
    speed, window = pairs[chosen]
    default = (
        f"default {REST_SPEED_M_S:g} m/s within {REST_WINDOW_S:g} s"
        if scale.has_rest
        else f"there is no default in {scale.speed}"
    )
    words = (
        f"rest_speed_m_s {speed:g} {scale.speed} within rest_window_s {window:g} {scale.t}, in which "
        f"{resting[chosen]} of {len(tried)} recordings come to rest (a gap at rest varies by "
        f"{_length(max(noise, step), scale)}; {default})"
    )
    return {"controller.rest_speed_m_s": speed, "controller.rest_window_s": window}, words


def _window(needed: float, least: float, scale: _Scale) -> float:
    window = max(least, _rounded(needed))
    return min(window, max(_MOST_WINDOW_S, least)) if scale.t == "s" else window


def _ends(measured: Sequence[_Noise], scale: _Scale, contact: float) -> tuple[dict[str, float], str]:
    """Return what keeps a recorded squeeze from being taken for one that failed, and why."""
    least = min(float(np.fmin.reduce(noise.gap)) for noise in measured)
    span = max(float(np.fmax.reduce(noise.gap)) for noise in measured) - least
    chosen: dict[str, float] = {}
    if scale.gap != "m":
        chosen = {
            "controller.too_wide_m": -max(span, 1.0),
            "controller.closed_gap_m": least - max(span, 1.0),
            "controller.crush_travel_m": _CRUSH_SHARE * span or 1.0,
        }
        words = (
            "no gap was recorded"
            if scale.gap == NO_GAP
            else f"nothing is too wide, closed or crushed by a gap in {scale.gap}"
        )
    else:
        travels = [noise.travel(contact) for noise in measured]
        close = sum(travel < _SOON_M for travel in travels)
        thin = sum(bool((noise.gap[noise.both >= contact] <= _CLOSED_M).any()) for noise in measured)
        parts = []
        if close:
            grown = -min(0.0, *travels)
            wide = -_rounded(grown) if grown else 0.0
            chosen["controller.too_wide_m"] = wide
            parts.append(
                f"too_wide_m {wide:g} m ({close} of {len(measured)} recordings touch within {_SOON_M * 1e3:g} mm of "
                "their beginning)"
            )
        if thin:
            chosen["controller.closed_gap_m"] = round(least - _SOON_M, 6)
            parts.append(
                f"closed_gap_m {chosen['controller.closed_gap_m']:g} m (in {thin} of {len(measured)} recordings both "
                f"pads feel an object in a gap of {_CLOSED_M * 1e3:g} mm or less)"
            )
        words = "; ".join(parts)
        if not any(float(np.ptp(noise.gap)) > 0.0 for noise in measured):
            words = "the gap does not change, so nothing is too wide or closed by it"
    if scale.t != "s":
        duration = float(np.median([noise.times[-1] - noise.times[0] for noise in measured]))
        chosen["controller.slip_time_s"] = max(_SLIP_SHARE * duration, 1.0)
    return chosen, words


def _steps(measured: Sequence[_Noise]) -> tuple[float, float, float]:
    """Return the least step of the gap, the time between its measurements, and that between samples."""
    steps, periods, sampled = np.array([noise.steps for noise in measured]).T
    return float(np.quantile(steps, 0.9)), float(np.quantile(periods, 0.9)), float(np.median(sampled))


def _seen(measured: Sequence[_Noise], scale: _Scale) -> str:
    """Return in words how finely the gap was measured."""
    step, period, sampled = _steps(measured)
    unit = "ms" if scale.t == "s" else scale.t
    factor = 1e3 if scale.t == "s" else 1.0
    words = f"; samples are {factor * sampled:.3g} {unit} apart"
    if step:
        words += f", the gap has steps of {_length(step, scale)}"
    return words + (f", it is measured every {factor * period:.3g} {unit}" if period else "")


def _length(length: float, scale: _Scale) -> str:
    return f"{length * 1e3:.2g} mm" if scale.gap == "m" else f"{length:.2g} {scale.gap}"


def _timeouts(
    recordings: Sequence[Recording], timeouts_s: Mapping[str, float], scale: _Scale
) -> tuple[dict[str, float], str]:
    """Return the time-outs that are shorter than a recording, extended to the longest one, and why."""
    longest = max(float(np.ptp(recording.frames[[0, -1], 0])) for recording in recordings)
    limit = min(_rounded(longest), _MOST_TIMEOUT_S) if scale.t == "s" else _rounded(longest)
    short = [key for key, value in timeouts_s.items() if value < longest]
    words = f"{' and '.join(short)} {limit:g} {scale.t} (recordings last up to {longest:.3g} {scale.t})"
    return {f"controller.{key}": limit for key in short}, words if short else ""


def _baseline(force: Numbers) -> float:
    """Return the force without contact of a sensor whose zero is not known: that of the first samples below a fifth."""
    known = force[~np.isnan(force)]
    if not len(known):
        return 0.0
    early = known[: max(int((known >= known.min() + _EARLY_SHARE * np.ptp(known)).argmax()), 1)]
    return float(np.median(early[: max(len(early) // 3, _FEW)]))


def _free_force(force: Numbers, baseline: float) -> float:
    """Return the largest force that noise without contact explains."""
    known = force[~np.isnan(force)]
    if len(known) <= _FEW:
        return baseline
    reached = known >= baseline + _EARLY_SHARE * (known.max() - baseline)
    early = known[: int(reached.argmax())] if reached.any() else known
    # The last part of a recording that begins close to the object is already a squeeze.
    early = early[: max(len(early) // 3, _FEW)]
    if len(early) < _FEW or _rises(early):
        return baseline + _FORCE_SIGMAS * _scatter_of_differences(known)
    middle = float(np.median(early))
    scatter = _FORCE_SIGMAS * _NORMAL * float(np.median(np.abs(early - middle)))
    return abs(middle) + scatter if baseline == 0.0 else middle + scatter


def _rises(force: Numbers) -> bool:
    """Return whether a force grows by more than its noise explains, so that something is squeezed already."""
    a_third = max(len(force) // 3, 1)
    growth = float(np.median(force[-a_third:]) - np.median(force[:a_third]))
    return growth > _FORCE_SIGMAS * _scatter_of_differences(force)


def _scatter_of_differences(values: Numbers) -> float:
    """Return the standard deviation of the noise of a smooth course, from its second differences."""
    curvature = np.diff(values, n=2)
    return _NORMAL * float(np.median(np.abs(curvature - np.median(curvature)))) / math.sqrt(6.0)


def _rounded(value: float, whole: Callable[[float], int] = math.ceil) -> float:
    """Return the value with two significant digits, not smaller unless `whole` rounds otherwise; at least 0."""
    if value <= 0.0:
        return 0.0
    digits = 1 - math.floor(math.log10(value))
    return round(whole(round(value * 10.0**digits, 6)) / 10.0**digits, max(digits, 0))
