"""What looks wrong in the forces and the gap of a recording, whatever it was read from.

Each check asks how a signal leaves its course: by which share of its range, in how many samples, and under which load.
Ranges are without glitches. The noise of a force is its usual second difference, its course the median around a sample.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.core.control.contact import CONTACT_FORCE_N
from graspsense.core.values.errors import counted
from graspsense.core.values.fingers import FingerForce
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.channel_facts import period_s, resolution, usual_range
from graspsense.sources.formats.table import Numbers

FEWEST: Final = 20
"""Fewest samples of a recording, of a load, and of a value that stays, from which on something is told of them."""
SLIGHT: Final = 0.02
"""Share of its range up to which a force or a gap is the same,"""
PART: Final = 0.1
"""from which on it is another one, and share of the samples from which on something is told of them,"""
FREE: Final = 0.2
"""and up to which a force is that of free fingers,"""
LOW: Final = 0.3
"""and up to which it grows within half of the travel on no object,"""
LOADED: Final = 0.5
"""and from which on they press."""
NOISE: Final = 10.0
"""What is no noise is at least so many times as large."""
ZERO_SAMPLES: Final = 10
"""Samples at an end of a recording that a zero is taken from, if they differ by a `PART` of the range at most."""
GLITCH_SAMPLES: Final = 3
GLITCH_S: Final = 0.05
"""Most samples and longest time (s) of one glitch: what lasts longer can be a tap."""
FAR_SAMPLES: Final = 10
FAR_S: Final = 0.2
FAR: Final = 2.0
"""The same of a glitch that exceeds so many times the range of a force under a load."""
MOST_GLITCHES: Final = 0.05
"""Largest share of all samples that are glitches: what is more frequent is the course of the force."""
LEAP: Final = 3.0
"""A leap is so many times the third largest step, since a glitch is two; a stop is so many times a usual hold."""
LEAP_SPEED_M_S: Final = 1.0
LEAP_M_S2: Final = 10.0
"""Speed beyond which no finger moves, and acceleration."""
LOADED_SAMPLES: Final = 5
"""A force that leaps after so many samples under a load is not that of a contact."""
UNEQUAL: Final = 0.12
"""Share of the force of both pads by which that of one is away from a half, or changes under load."""
ROUGH_S: Final = 0.1
"""Time (s) over which a force is averaged: single values that are usually farther away than `SLIGHT` are not known."""
LATE_S: Final = 0.04
"""A force or a gap that is later than this (s), and than two samples, is late."""
CREEP: Final = 0.15
"""Share of its range by which a force grows at rest as its sensor creeps."""
SELDOM_S: Final = 0.05
SELDOM_ROWS: Final = 5
"""A force or gap that keeps each value for so long, and so many samples, is measured more rarely than the rows."""
KNOTS: Final = 6
FINE_SHARE: Final = 2e-4
"""Fewest values at a steady rate with straight lines between them, in smaller steps than this share of their range."""
LINE: Final = 10
"""Fewest samples of a straight line that is no chance in noise,"""
FINE: Final = 5.0
BEND: Final = 2.5
"""whose second difference is so many steps of a signal at least, and so many at most in a line that was rounded."""
CHANGES: Final = 15.0
"""Number of changes that a force would have had in the time in which its sensor has stopped."""
TURNS: Final = 0.3
"""Share of the changes without a load that go against the one before, where they are noise."""
LARGEST_COUNTS: Final = frozenset(float(2**bits - 1) for bits in (8, 10, 12, 14, 15, 16))
"""The ends of the ranges of converters, in counts."""


def with_notices(labelled: LabelledRecording) -> LabelledRecording:
    """Return the recording with all that looks wrong: what its reader noticed, and what its signals show.

    The recording itself has it too, so that a replay and a stored trial tell it.
    """
    notices = (*labelled.notices, *labelled.recording.notices, *signal_notices(labelled.recording))
    notices = tuple(dict.fromkeys(notices))
    return evolve(labelled, notices=notices, recording=evolve(labelled.recording, notices=notices))


def notices_together(recordings: Sequence[LabelledRecording]) -> tuple[str, ...]:
    """Return what looks wrong in recordings, the most frequent first, each with the number of recordings.

    What differs in its numbers alone is one, with the most frequent of these as an example.
    """
    kinds: dict[str, Counter[str]] = {}
    for recording in recordings:
        alike = {re.sub(r"\d+(?:\.\d+)?", "0", notice): notice for notice in recording.notices}
        for kind, notice in alike.items():
            kinds.setdefault(kind, Counter())[notice] += 1
    every, total = sorted(kinds.values(), key=lambda alike: -alike.total()), counted(len(recordings), "grasp")
    return tuple(
        f"{alike.total()} of {total}{', for example' * (len(alike) > 1)}: {alike.most_common(1)[0][0]}"
        for alike in every
    )


@frozen(eq=False)
class _Force:
    """A force and the gap by time, where all have a number, and what is measured of the force."""

    what: str
    t: Numbers
    gap: Numbers
    n: Numbers
    units: Mapping[str, str]

    def __len__(self) -> int:
        return len(self.n)

    @cached_property
    def low(self) -> float:
        return usual_range(self.n)[0]

    @cached_property
    def span(self) -> float:
        return usual_range(self.n)[1] - self.low

    @cached_property
    def noise(self) -> float:
        return NOISE * float(np.median(np.abs(np.diff(self.n, 2))))

    def above(self, share: float) -> NDArray[np.bool_]:
        """Return which samples are above this share of the range."""
        return self.n > self.low + share * self.span

    def when(self, k: int) -> str:
        """Return the time of a sample in words."""
        return f"{self.t[k]:.4g} {self.units.get('t', 's')}"

    def amount(self, force: float, form: str = ".3g") -> str:
        """Return a force in words."""
        return f"{force:{form}} {self.units.get('force_left', 'N')}"


def signal_notices(recording: Recording) -> Iterator[str]:
    """Return what looks wrong in the forces of the pads and in the gap.

    A force has no number, one value all along, or a value that stays; a glitch; or a zero that drifts. The gap jumps,
    or stays while the force changes.
    """
    t, gap, left, right = columns = recording.columns("t_s", "gap_m", "force_left_n", "force_right_n")
    columns[~np.isfinite(columns)] = np.nan
    measured = [signal for signal in (gap, left, right) if np.isfinite(signal).any()]
    known = np.isfinite([t, *measured]).all(axis=0)
    pads = [
        _Force(what, t[known], gap[known], force[known], recording.units)
        for what, force in force_of_pads(left, right).items()
    ]
    forces = [pad for pad in pads if np.isfinite(pad.n).all()]
    told = [text for pad in pads for text in _of_sensor(pad)]
    if int(known.sum()) < FEWEST or not forces:
        yield from told
        return
    mean = evolve(forces[0], what="the force", n=np.mean([force.n for force in forces], axis=0))
    hand = any(isinstance(channel, FingerForce) for channel in recording.channels)
    if not told and len(forces) > 1:
        told += [text for pair in (forces, forces[::-1]) for text in _numb(*pair)]
        told += _unequal(*forces) if not told and not hand else ()
        told += _parted(*forces) if not told and not hand else ()
    for force in forces:
        if "t" not in recording.units:
            doubtful = bool(told)
            told += [*_glitches(force), *_seldom(force.what, force.t, force.n, FREE)]
            told += [] if doubtful else _rough(force)
        told += _drift(force)
    told += _twice(mean)
    told = told or [*_rises_at_once(mean), *_falls_at_once(mean)]
    if not {"gap", "t"} & recording.units.keys():
        told += _bump(mean)
        gap_mm = evolve(mean, what="the gap", n=1e3 * mean.gap, units={"force_left": "mm"})
        told += [*_glitches(gap_mm), *_filled(gap_mm)] or _gap_leaps(mean.t, mean.gap)
        told += _stopped_gap(mean)
    if "t" not in recording.units:
        told += next(filter(None, (list(_late(force, doubtful=bool(told))) for force in forces)), ())
    yield from told


def force_of_pads(left: Numbers, right: Numbers) -> dict[str, Numbers]:
    """Return the force of each pad by its name in a sentence; of both together where one stands for both."""
    if np.array_equal(left, right, equal_nan=True):
        return {"the force": left}
    return {"the force of the left pad": left, "the force of the right pad": right}


def median_course(values: Numbers, longest: int) -> Numbers:
    """Return values without what lasts at most so many samples."""
    around = np.pad(values, longest, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * longest + 1), axis=1)


def _mean(values: Numbers, width: int) -> Numbers:
    """Return the mean of values over an odd number of samples around each."""
    return np.convolve(np.pad(values, width // 2, mode="edge"), np.full(width, 1.0 / width), mode="valid")


def _leap(steps: Numbers, within: NDArray[np.bool_], least: float) -> int | None:
    """Return the sample to which a signal leaps: by more than this, and than elsewhere; None if it does not."""
    k = int(np.argmax(steps * within))
    return k + 1 if steps[k] * within[k] > max(least, LEAP * float(np.sort(np.abs(steps))[-3])) else None


def _runs(values: Numbers) -> list[tuple[int, int]]:
    """Return the first sample of each time in which a value stays, and the one after its last."""
    return [*pairwise([0, *(np.flatnonzero(np.diff(values)) + 1).tolist(), len(values)])]


def _of_sensor(force: _Force) -> Iterator[str]:
    """Yield that a force was not measured, or not all the time."""
    if len(force) > 1 and np.isnan(force.n).all():
        yield f"{force.what} has no number: was the sensor connected?"
    elif len(force) > 2 and not np.ptp(force.n):
        yield f"{force.what} does not change: is it another column, did its sensor stop, or was nothing touched?"
    elif len(force) >= FEWEST and (held := _held(force.n)) is not None:
        begin, end = held
        stays = f"one value from {force.t[begin]:.4g} to {force.when(end - 1)}"
        repeats = stays if end < len(force) else "its last value to the end"
        yield (
            f"{force.what} repeats {repeats}, although it varied before: did its sensor stop, or is it "
            "at the end of its range?"
        )
    elif len(force) >= FEWEST:
        yield from _filled(force)


def _filled(signal: _Force) -> Iterator[str]:
    """Yield that a signal with noise is a straight line while it changes, as between samples that were missing."""
    if not signal.noise > NOISE * FINE * (resolution(signal.n) or np.inf):
        return
    for begin, end in pairwise([0, *(_bends(signal.n) + 1).tolist(), len(signal) - 1]):
        if end - begin >= LINE and abs(signal.n[end] - signal.n[begin]) > PART * signal.span:
            yield (
                f"{signal.what} is a straight line from {signal.t[begin]:.4g} to {signal.when(end)}, although it has "
                "noise: were missing samples filled in? A contact or a rest in this time is not known"
            )
            return


def _bends(values: Numbers) -> NDArray[np.int64]:
    """Return the samples behind which values leave a straight line by more than their rounding."""
    return np.flatnonzero(np.abs(np.diff(values, 2)) > BEND * (resolution(values) or 0.0))


def _held(force: Numbers) -> tuple[int, int] | None:
    """Return the samples in which a force that varies also without a load, by its noise, repeats a value; else None.

    A value in coarse counts can stay within its step. It is told only if it stays to the end, and for long, or if it is
    the largest of a converter.
    """
    steps, runs = np.diff(force), _runs(force)
    changed = steps != 0.0
    free = force[:-1] < force.min() + FREE * np.ptp(force)
    for begin, end in (runs[-1], max(runs, key=lambda run: run[1] - run[0])):
        others = free.copy()
        others[begin : end - 1] = False
        repeated = end - begin - 1
        if repeated >= FEWEST and force[begin] == force.max() and force.max() in LARGEST_COUNTS:
            return begin, end
        noise = steps[others & changed]
        turns = noise[1:] * noise[:-1] < 0.0  # noise goes up and down, and a force that is built up does not
        # Many sensors say 0 without a load.
        unloaded = force[begin] == force.min() > force[0] - SLIGHT * np.ptp(force)
        if unloaded or not len(turns) or repeated * changed[others].mean() < CHANGES or turns.mean() < TURNS:
            continue
        large = np.abs(noise) > 1.5 * np.abs(steps[changed]).min()
        fine = (large[1:] & large[:-1] & turns).mean() > PART
        if fine or (end == len(force) and repeated >= PART * len(force)):
            return begin, end
    return None


def _numb(pad: _Force, other: _Force) -> Iterator[str]:
    """Yield that a pad feels nothing but its noise while the other one is loaded, and the gap has not opened.

    One that touches the object late does so for a while; one that felt it before and feels it again had failed.
    """
    span, noise = other.span, max(pad.noise, other.noise)
    if not other.span > 0.0:
        return
    # The mean of so many samples tells a load from the noise of single ones.
    width = 2 * int(0.5 * (noise / (FREE * span)) ** 2) + 1
    felt_n, other_n = _mean(pad.n, width), _mean(other.n, width)
    loaded = other_n > other.low + LOADED * span
    begin, noise = int(loaded.argmax()), noise / math.sqrt(width)
    free = other_n[:begin] < other.low + PART * span + noise
    # Without an object, the mean of noise has a small part of its range.
    if not free.any() or width > np.count_nonzero(loaded) or np.ptp(other_n) < LOADED * span:
        return
    zero = float(np.median(felt_n[:begin][free]))
    away = np.abs(felt_n - zero)
    loaded &= pad.gap <= pad.gap[begin]
    numb, felt = loaded & (away < max(noise, SLIGHT * span)), away > FREE * span
    if np.count_nonzero(numb) < max(FEWEST, PART * np.count_nonzero(loaded)):
        numb &= np.logical_or.accumulate(felt) & np.logical_or.accumulate(felt[::-1])[::-1]
    if np.count_nonzero(numb) > GLITCH_SAMPLES:
        from_k, until_k = np.flatnonzero(numb)[[0, -1]].tolist()
        yield (
            f"{pad.what} stays at {pad.amount(zero)} from {pad.t[from_k]:.4g} to {pad.when(until_k)}, while the other "
            f"pad feels up to {other_n[numb].max():.3g}: does its fingertip not answer, or did one finger alone touch?"
        )


def shares_under_load(left: Numbers, right: Numbers) -> Numbers:
    """Return the share of the force of both pads that the right one bears, in each sample under a load."""
    of_left, of_right = (np.abs(pad - np.median(pad[:ZERO_SAMPLES])) for pad in (left, right))
    both = of_left + of_right
    low, high = usual_range(both)
    loaded = both > low + LOADED * (high - low)
    shares: Numbers = of_right[loaded] / both[loaded]
    return shares


def _unequal(left: _Force, right: _Force) -> Iterator[str]:
    """Yield that two pads do not bear the same force, or not all the time: as opposed pads they have to.

    Counts of two sensors need not be the same, but what they are of each other stays.
    """
    shares = shares_under_load(left.n, right.n)
    if len(shares) < FEWEST or not any(pad.span > pad.noise for pad in (left, right)):
        return
    least, usual, most = np.quantile(shares, (PART, 0.5, 1.0 - PART))  # a pad can touch first or let go last
    if most - least > UNEQUAL or (abs(usual - 0.5) > UNEQUAL and "force_left" not in left.units):
        yield (
            f"the right pad bears {100 * least:.0f} % to {100 * most:.0f} % of the force of both under load, and half "
            "is due: were the pads exchanged, does one read wrong, or did the object lie on one of them only in part?"
        )


def _parted(left: _Force, right: _Force) -> Iterator[str]:
    """Yield that the forces of two loaded pads part at once: one failed or came back, or they were exchanged."""
    forces = [pad.n - np.median(pad.n[:ZERO_SAMPLES]) for pad in (left, right)]
    span = evolve(left, n=(forces[0] + forces[1]) / 2.0).span
    larger, loaded = np.maximum(*forces), np.minimum(*forces) > FREE * span
    if not loaded.any():
        return
    scale = float(np.median(forces[0][loaded] / forces[1][loaded]))
    steps = np.abs(np.diff(median_course(forces[0] - scale * forces[1], GLITCH_SAMPLES)))
    # Where fingers meet an object, or let it go, one of them can be first.
    held = np.flatnonzero(larger > LOADED * larger.max())
    within = loaded[1:] | loaded[:-1]
    within[: min(int(loaded.argmax()), int(held[0]))] = False
    within[held[-1] - 1 :] = False
    k = _leap(steps, within, max(PART * span, NOISE * float(np.median(steps))))
    if k is not None:
        yield (
            f"the forces of the pads part by {left.amount(steps[k - 1])} at {left.when(k)}: did one of them fail for a "
            "while, or were they exchanged?"
        )


def _rises_at_once(force: _Force) -> Iterator[str]:
    """Yield that a force under a load rises within a sample, as where some are missing, or after its sensor stopped."""
    steps = np.diff(median_course(force.n, GLITCH_SAMPLES))
    samples, free = np.arange(len(steps)), np.flatnonzero(~force.above(FREE))
    loaded = samples - free[np.searchsorted(free, samples, side="right") - 1] >= LOADED_SAMPLES
    k = _leap(steps, loaded, max(PART * force.span, force.noise))
    if k is not None:
        yield (
            f"the force rises by {force.amount(steps[k - 1])} at once at {force.when(k)}, under a load: are samples "
            "missing there, or did its sensor stop before?"
        )


def _falls_at_once(force: _Force) -> Iterator[str]:
    """Yield that a force falls within a sample and grows again, while the fingers have not opened.

    A tap on the way, which falls so as it rose, is none.
    """
    course, gap = median_course(force.n, GLITCH_SAMPLES), force.gap
    steps, closed = np.diff(course), gap <= np.minimum.accumulate(gap) + SLIGHT * np.ptp(gap)
    k = _leap(-steps, closed[1:], max(FREE * force.span, force.noise))
    if k is None or steps.max() > LOADED * -steps[k - 1]:
        return
    fallen = course[k:][np.logical_and.accumulate(closed[k:])]
    if (fallen - np.minimum.accumulate(fallen)).max(initial=0.0) > FREE * force.span:
        yield (
            f"the force falls by {force.amount(course[k - 1] - course[k])} at once at {force.when(k)}, and then grows "
            "again in the closed fingers: did the object break or slip, or was the zero of the sensor set under a load?"
        )


def _rough(force: _Force) -> Iterator[str]:
    """Yield that a force varies so much around its mean course, or has so coarse steps, that no value tells it."""
    width = 2 * max(2, round(0.5 * ROUGH_S / float(np.median(np.diff(force.t))))) + 1
    if len(force) < 2 * width or not force.span > 0.0:
        return
    varies = float(np.median(np.abs(force.n - _mean(force.n, width)))) / force.span
    steps = np.diff(np.unique(force.n))
    counts = steps / steps.min()
    if varies > SLIGHT:
        yield f"{force.what} varies by {100 * varies:.0f} % of its range around its course, and so do its features"
    elif steps.min() > PART * force.span and np.allclose(counts, np.round(counts)):
        yield (
            f"{force.what} has steps of {100 * steps.min() / force.span:.0f} % of its range: each value is up to half "
            "a step off"
        )


def _twice(force: _Force) -> Iterator[str]:
    """Yield that samples come again, all in the same order, while the force changes: noise does not repeat itself."""
    pairs = np.column_stack((force.gap, force.n))
    new = np.flatnonzero((np.diff(pairs, axis=0) != 0.0).any(axis=1)) + 1
    same = np.unique(pairs[new], axis=0, return_inverse=True)[1].ravel()
    order, since = np.argsort(same, kind="stable"), np.zeros(len(new))
    since[order[1:]] = np.diff(order) * (np.diff(same[order]) == 0)
    for begin, end in _runs(since) if len(new) else ():
        block = new[begin:end]
        if min(since[begin], len(block)) >= LINE and np.ptp(force.n[block]) > PART * force.span:
            yield (
                f"the samples from {force.t[new[begin - int(since[begin])]]:.4g} s on come again at "
                f"{force.when(block[0])}, {len(block)} of them: were lines written twice? All later times are then too "
                "late"
            )
            return


def _glitches(force: _Force) -> Iterator[str]:
    """Yield that a force leaves its course for a few samples: without a load, or by most of its range anywhere."""
    changes = np.flatnonzero(np.diff(force.n)) + 1
    # A sensor that is slower than the rows repeats its values.
    every = max(1, round(float(np.median(np.diff(changes))))) if len(changes) > 1 else 1
    sampled, t = force.n[::every], force.t[::every]
    if len(sampled) < FEWEST:
        return
    step_s, span = float(np.median(np.diff(t))), float(np.ptp(sampled))
    # A single value of noise bends the force by twice as much as it is away.
    noise = max(LEAP * np.median(np.abs(np.diff(sampled, 2))), BEND / 2.0 * (resolution(sampled) or 0.0))
    left = np.zeros(len(sampled), dtype=np.bool_)
    # Under a load, nothing exceeds all other forces several times and then comes back, however rarely it is measured.
    for samples, longest_s, free_share, loaded_share in (
        (GLITCH_SAMPLES, GLITCH_S, PART * span, LOADED * span),
        (FAR_SAMPLES, max(FAR_S, step_s), np.inf, FAR),
    ):
        course = median_course(sampled, min(samples, int(longest_s / step_s)))
        apart, free = np.abs(sampled - course), course < course.min() + PART * np.ptp(course)
        loaded_share *= np.ptp(course) if loaded_share == FAR else 1.0
        left |= apart > np.where(free, free_share, loaded_share).clip(max(NOISE * np.median(apart), noise))
    count, k = int(left.sum()), int(np.argmax(left))
    if 0 < count <= MOST_GLITCHES * len(sampled):
        others = f", and {count - 1} more" if count > 1 else ""
        yield (
            f"{force.what} leaves its course for a moment ({force.amount(sampled[k], '.4g')} at {t[k]:.4g} s{others}): "
            "if it is no impact, no break and no current of a drive that starts, take it out, since a glitch can pass "
            "for a contact or a rest"
        )


def _seldom(what: str, t_s: Numbers, values: Numbers, large: float) -> Iterator[str]:
    """Yield that values are new so rarely (s) that they change by a `large` share of their range at once."""
    changes, bends = np.flatnonzero(np.diff(values)) + 1, _bends(values) + 1
    knots = bends[np.diff(bends, prepend=-2) > 1]
    apart = np.diff([0, *knots.tolist(), len(values)])
    fine = (resolution(values) or 0.0) < FINE_SHARE * np.ptp(values)
    # Lines between values at a steady rate are no measurement.
    if fine and len(knots) >= max(KNOTS, 0.5 * len(bends)) and apart.max() <= LEAP * np.median(apart):
        changes = knots
    if len(changes) < 2:
        return
    every_s = float(np.quantile(np.diff(t_s[changes]), PART))
    rows = float(np.quantile(np.diff(changes), PART))
    most = np.abs(np.diff(values[changes], prepend=values[0])).max()
    if every_s >= SELDOM_S and rows >= SELDOM_ROWS and most > large * np.ptp(values):
        yield (
            f"{what} has a new value every {every_s:.2g} s only, more rarely than the rows: a contact is seen up to so "
            "much too late, and a rest with an older value"
        )


def _drift(force: _Force) -> Iterator[str]:
    """Yield that a force does not come back when the fingers are open again."""
    runs, span, gap = _runs(force.n), float(np.ptp(force.n)), force.gap
    if len(runs) <= FEWEST:  # measured too rarely, unless its last value stays for longer than others did
        longest = max((end - begin for begin, end in runs[1:-1]), default=0)
        if len(runs) < 3 or runs[-1][1] - runs[-1][0] <= max(FEWEST, LEAP * longest):
            return
    begin, end = force.n[:ZERO_SAMPLES], force.n[-ZERO_SAMPLES:]
    first_load, peak = int(np.argmax(force.n > force.n[0] + FREE * span)), int(force.n.argmax())
    opened = gap[-1] >= gap[first_load] and min(gap[0], gap[-1]) > gap[peak] + PART * np.ptp(gap)
    apart = float(end.mean() - begin.mean())
    if max(np.ptp(begin), np.ptp(end)) <= PART * span < abs(apart) and opened:
        yield (
            f"{force.what} ends {force.amount(apart, '+.3g')} from where it began, although the fingers are "
            "open again: its zero drifts, and all forces have a part of that, or its sensor stopped"
        )


def _bump(force: _Force) -> Iterator[str]:
    """Yield that a force comes, is gone while the gap (m) closes further, and comes back, by time (s)."""
    gap, course = force.gap, median_course(force.n, 1)
    course = course - usual_range(course)[0]
    least = PART * float(np.ptp(course))
    contact = max(least if "force_left" in force.units else min(least, CONTACT_FORCE_N), force.noise)
    begin, pressed = int((course > contact).argmax()), int((course > LOW * np.ptp(course)).argmax())
    gone = course[begin:] < 0.5 * contact
    end = begin + int(gone.argmax()) if gone.any() else len(course) - 1
    again = end + int((course[end:] > contact).argmax())
    closes = float(gap[end] - gap[again])
    glitch = end - begin <= GLITCH_SAMPLES and force.t[end] - force.t[begin] <= GLITCH_S
    if closes > 0.5 * PART * np.ptp(gap) and gap[end:again].max() <= gap[begin] and not glitch:
        yield (
            f"a force comes at {force.when(begin)} and is gone at {force.when(end)}, the fingers close by "
            f"{closes * 1e3:.3g} mm more, and it comes back at {force.when(again)}: the contact is the first of these. "
            "If it is something on their way, or the current with which a drive starts, cut it out; or the object broke"
        )
    elif not glitch and gap[begin] - gap[pressed] > LOADED * np.ptp(gap):
        yield (
            f"a force comes at {force.when(begin)} and stays low until {force.when(pressed)}, while the fingers close "
            f"by {(gap[begin] - gap[pressed]) * 1e3:.3g} mm: is it friction of the drive, as in a motor current, or "
            "a zero that drifts? Then subtract it, since it passes for the contact"
        )


def _late(force: _Force, *, doubtful: bool) -> Iterator[str]:
    """Yield that a force and its gap (m) are not of one time: no object presses more than when the fingers came.

    A late force stays while they are wider than at the contact. A late gap goes on after the contact, and opens after
    the force is gone. If it is not `doubtful` for another reason: a force grows while they rest, by more than its creep
    and what they still close explain, or it begins when they rest on something rigid.
    """
    t, gap, n = force.t, median_course(force.gap, 1), median_course(force.n, 1) - force.low
    loaded, free = np.flatnonzero(n > LOADED * force.span), np.flatnonzero(n < PART * force.span)
    if not len(loaded):
        return
    begin, pressed, span = int(free[free < loaded[0]].max(initial=0)), int(loaded[0]), float(np.ptp(gap))
    end = int(free[free > pressed].min(initial=len(t)))
    # Behind its peak, a gap whose sensor stopped can go on to another value.
    peak = begin + int(n[begin:end].argmax())
    narrowest, step = float(gap[begin : peak + 1].min()), resolution(force.gap) or 0.0
    bends = np.abs(np.diff(force.gap, 2))
    # The steps of a coarse gap that moves are no noise.
    noise = NOISE * float(np.median(bends * (bends > BEND * step)))
    travel = float(gap[begin]) - narrowest
    still = max(SLIGHT * travel, noise, LEAP * step)
    rests = gap <= narrowest + (still if travel > still else noise)
    came = int(rests[:end].argmax())
    least_s = max(LATE_S, *(2.5 * period_s(t, values) for values in (t, force.gap, force.n)))
    stays = np.flatnonzero((gap[came:end] > gap[begin] + SLIGHT * span) & (n[came:end] > LOADED * force.span))
    if travel > still:
        explained = n[: came + 1].max() + (CREEP + 2.0 * still / travel) * force.span
        later, begins_s = t[came:end][rests[came:end] & (n[came:end] > explained)], 0.0
    else:
        later = t[came:pressed][n[came:pressed] < SLIGHT * force.span]
        # They can still close by a step of the gap.
        begins_s = LOADED * float(t[pressed] - t[begin]) + period_s(t[:came], gap[:came])
    lasts_s = float(later[-1] - later[0]) if len(later) else 0.0
    opens = end - 1 + int((gap[end - 1 :] > narrowest + 0.5 * SLIGHT * span).argmax())
    late_s = float(t[opens] - t[end - 1])
    around_s = t[begin] + late_s * np.arange(-1, 2)
    approach, further = -np.diff(np.interp(around_s, t, gap))
    goes_on = further > FREE * approach > 0.5 * SLIGHT * span and around_s[0] >= t[0]
    closes = float(np.interp(t[end - 1] - late_s, t, gap)) - gap[end - 1] > FREE * approach
    if end < len(t) and len(stays) and t[came + stays[-1]] - t[came + stays[0]] > least_s:
        yield (
            f"{force.what} stays until {force.when(came + stays[-1])}, although the fingers are wider than at the "
            f"contact from {force.when(came + stays[0])} on: does the force come late, or did its sensor stop?"
        )
    elif late_s > least_s and goes_on and not closes and "gap" not in force.units:
        yield (
            f"the fingers go on as fast after the force begins (at {force.when(begin)}), and open {late_s:.2g} s "
            "after it is gone: does the gap come late?"
        )
    elif not doubtful and came and lasts_s > least_s + begins_s:
        grown = 100.0 * float(n[begin:end].max() - n[came]) / force.span
        yield (
            f"{force.what} grows by {grown:.0f} % of its range after {force.when(came)}, while the fingers rest: does "
            "it come late, was it smoothed, does the drive press on (a servo, or the current of one with friction), or "
            "is something hard in a soft layer, or left of what broke? If it is late, a contact is too"
        )


def _gap_leaps(t_s: Numbers, gap: Numbers) -> Iterator[str]:
    """Yield that a gap (m) leaps faster (s) than fingers move, or has new values so rarely that it changes by much."""
    moved, usual_s = np.diff(gap), float(np.median(np.diff(t_s)))
    # Fingers can open much faster than they close, so a closing is compared with closings.
    for steps in (np.maximum(-moved, 0.0), np.abs(moved)):
        if np.count_nonzero(steps) < FEWEST:
            continue
        k, usual = int(steps.argmax()), float(np.sort(steps)[-3])
        seconds = max(float(np.diff(t_s)[k]), usual_s)
        # A gap that is measured more rarely than the rows moves in the time between its values. Fingers that close as
        # before on both sides were faster for this time alone.
        measured_s = max(seconds, period_s(t_s, gap))
        if gap[k + 1] < gap[k] and np.abs(moved[max(k - 1, 0) : k + 2]).sum() <= steps[k] + 2.0 * usual:
            measured_s /= 2.0
        least = min(LEAP_SPEED_M_S * seconds, usual + LEAP_M_S2 * measured_s**2)
        if _leap(steps, steps > 0.0, least) is not None:
            yield (
                f"the gap jumps by {steps[k] * 1e3:.3g} mm within {seconds * 1e3:.3g} ms (at {t_s[k + 1]:.4g} s), "
                "as no finger does: is it a glitch, or did its sensor stop before?"
            )
            break
    steps = np.abs(moved)
    # The steps of a coarse gap are alike.
    if LEAP * steps.min(initial=np.inf, where=steps > 0.0) < steps.max():
        yield from _seldom("the gap", t_s, gap, PART)


def _stopped_gap(force: _Force) -> Iterator[str]:
    """Yield that a gap (m) stays to the end, by time (s), although the force changed and is gone."""
    begin, end = _runs(force.gap)[-1]
    longest = max(FEWEST, LEAP * float(np.median([end - begin for begin, end in _runs(force.gap)])))
    changed = end - begin >= longest and np.ptp(force.n[begin:]) > FREE * force.span
    if begin and changed and force.above(LOADED)[begin:].any() and not force.above(PART)[-1]:
        yield (
            f"the gap stays at {force.gap[begin] * 1e3:.4g} mm from {force.t[begin]:.4g} to {force.when(end - 1)}, "
            "although the force is gone: did its sensor stop?"
        )
