"""What looks wrong in the forces and the gap of a recording, whatever it was read from."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Final

import numpy as np
from attrs import evolve

from graspsense.core.control.contact import CONTACT_FORCE_N
from graspsense.core.values.fingers import FingerForce
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.usual_range import usual_range
from graspsense.sources.formats.table import Numbers

FEWEST: Final = 20
"""Fewest samples from which on a force that has stopped is told from one that is steady."""
STOPPED: Final = 0.1
"""Share of a recording for which a force in coarse counts repeats its last value when its sensor has stopped."""
CHANGES: Final = 20.0
"""Number of changes that a force would have had in the time in which its sensor has stopped."""
LARGEST_COUNTS: Final = frozenset(float(2**bits - 1) for bits in (8, 10, 12, 14, 15, 16))
"""The ends of the ranges of converters, in counts."""
TURNS: Final = 0.3
"""Share of the changes without a load that go against the one before, where they are noise."""
LARGE_TURNS: Final = 0.1
"""Share of the changes without a load that turn and exceed the least one, where the steps of a force are fine."""
FEWEST_IN_COURSE: Final = 30
"""Fewest samples from which on the course of a force is told from a glitch."""
GLITCH_SAMPLES: Final = 3
GLITCH_S: Final = 0.05
"""Most samples and longest time (s) of one glitch: what lasts longer can be a tap."""
MOST_GLITCHES: Final = 0.05
"""Largest share of all samples that are glitches: what is more frequent is the course of the force."""
FREE_GLITCH: Final = 0.1
LOADED_GLITCH: Final = 0.5
"""Share of its range by which a force leaves its course in a glitch: up to this share of the force, and above it."""
GLITCH_NOISE: Final = 10.0
"""A glitch is at least so many times the usual distance from the course."""
NUMB: Final = 0.02
"""Share of the range of the other pad up to which a pad feels nothing,"""
NUMB_SHARE: Final = 0.1
"""and of the samples in which the other one is loaded, from which on that is told."""
UNEQUAL: Final = 0.12
"""Share of the force of both pads by which that of one is away from a half, or changes under load,"""
UNEQUAL_REST: Final = 0.1
"""without this share of the samples at each end, in which a pad can touch first or let go last."""
PARTED: Final = 0.1
"""Share of its range by which the force of a loaded pad leaves that of the other one at once, or rises,"""
LOADED_SAMPLES: Final = 5
"""after so many samples under a load."""
ROUGH_S: Final = 0.1
ROUGH: Final = 0.02
"""Time (s) over which a force is averaged, and the share of its range that it usually is away from that,"""
COARSE: Final = 0.05
"""and half a step of it, from which on a single value is not known."""
OPENS: Final = 0.02
"""Share of its range by which a gap is wider than at the contact when no object can press any more,"""
STILL: Final = 0.01
"""and by which it changes where the fingers begin to open,"""
LATE_S: Final = 0.04
LATE_SAMPLES: Final = 2.0
"""if that lasts for more than so long (s), and so many samples,"""
GOES_ON: Final = 0.2
"""and share of its speed with which a gap that comes late goes on after the contact."""
FAR: Final = 2.0
FAR_S: Final = 0.2
FAR_SAMPLES: Final = 10
"""A force under a load that leaves its course by so many times the range of that is a glitch if it takes no longer."""
ZERO_SAMPLES: Final = 10
STEADY: Final = 0.1
"""Share of its range by which a force may change in the samples that its zero is taken from."""
OPENED: Final = 0.1
"""Share of its range by which a gap is wider than at the largest force where the fingers are open."""
DRIFT: Final = 0.1
"""Share of its range by which a force may end from where it began."""
JUMP_SPEED_M_S: Final = 1.0
JUMP_M_S2: Final = 10.0
"""Speed beyond which no finger moves, and acceleration,"""
JUMP: Final = 3.0
"""and how many times farther than the third largest step of the gap a jump goes, since a glitch is two steps."""
USUAL_HOLDS: Final = 3.0
"""A gap stays for so many times as long as it usually has a value, at least, when its sensor has stopped."""
STOPPED_STEPS: Final = 5.0
"""Least steps of a gap that one goes on by, at least, when its sensor had stopped."""
SELDOM_S: Final = 0.05
SELDOM_ROWS: Final = 5
"""A force or gap that keeps each value for so long, and so many samples, is measured more rarely than the rows."""
LARGE_CHANGE: Final = 0.2
LARGE_STEP: Final = 0.1
"""Share of its range by which such a force, or such a gap, changes at once where contact and rest are seen too late."""
FEWEST_CHANGES: Final = 2
SELDOM_SHARE: Final = 0.1
"""Share of the changes of such a force that may be closer to the one before."""
FREE: Final = 0.2
"""Share of its range up to which a force is that of free fingers."""
BUMP_TRAVEL: Final = 0.05
"""Share of its range by which the gap closes after a bump."""


def with_notices(labelled: LabelledRecording) -> LabelledRecording:
    """Return the recording with all that looks wrong: what its reader noticed, and what its signals show.

    The recording itself has it too, so that a replay and a stored trial tell it.
    """
    notices = (*labelled.notices, *labelled.recording.notices, *signal_notices(labelled.recording))
    notices = tuple(dict.fromkeys(notices))
    return evolve(labelled, notices=notices, recording=evolve(labelled.recording, notices=notices))


def signal_notices(recording: Recording) -> Iterator[str]:
    """Return what looks wrong in the forces of the pads and in the gap.

    A force has no number, one value all along, or a value that stays; a glitch; or a zero that drifts. The gap jumps,
    or stays while the force changes.
    """
    times = np.array([reading.frame.t_s for reading in recording.readings])
    gap = np.array([reading.frame.gap_m for reading in recording.readings])
    left = np.array([reading.frame.force_left_n for reading in recording.readings])
    right = np.array([reading.frame.force_right_n for reading in recording.readings])
    pads = force_of_pads(left, right)
    told = [text for what, force in pads.items() for text in _of_sensor(what, times, force, recording.units)]
    if not told and len(pads) > 1:
        for what, other in zip(pads, (right, left), strict=True):
            told += _numb(what, times, gap, pads[what], other, recording.units)
        hand = any(isinstance(channel, FingerForce) for channel in recording.channels)
        told += _unequal(left, right, recording.units) if not told and not hand else ()
        told += _parted(times, left, right, recording.units) if not told and not hand else ()
    for what, force in pads.items():
        known = np.isfinite(force)
        if int(known.sum()) >= FEWEST:
            of_pad = times[known], force[known]
            if "t" not in recording.units:
                doubtful = bool(told)
                told += [*_glitches(what, *of_pad, recording.units), *_seldom(what, *of_pad, LARGE_CHANGE)]
                told += [] if doubtful else _rough(what, *of_pad)
            told += _drift(what, gap[known], force[known], recording.units)
    yield from told or _rises_at_once(times, (left + right) / 2.0, recording.units)
    if not {"gap", "t"} & recording.units.keys() and len(gap) >= FEWEST:
        yield from _bump(times, gap, (left + right) / 2.0, recording.units)
        yield from next(filter(None, ([*_late(what, times, gap, force)] for what, force in pads.items())), ())
        yield from _jump(times, gap)
        steps = np.abs(np.diff(gap))
        # The steps of a coarse gap are alike.
        if JUMP * steps.min(initial=np.inf, where=steps > 0.0) < steps.max():
            yield from _seldom("the gap", times, gap, LARGE_STEP)
        yield from _stopped_gap(times, gap, (left + right) / 2.0)


def _of_sensor(what: str, times: Numbers, force: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield what tells that a force was not measured, or not all the time."""
    finite = np.isfinite(force)
    known, known_times = force[finite], times[finite]
    if len(force) > 1 and not len(known):
        yield f"{what} has no number: was the sensor connected?"
    elif len(known) > 2 and known.min() == known.max():
        yield f"{what} does not change during the recording: is it another column, or did its sensor stop?"
    elif (held := _held(known)) is not None:
        begin, end = known_times[held.start], known_times[held.stop - 1]
        repeats = (
            "its last value to the end"
            if held.stop == len(known)
            else f"one value from {begin:.4g} to {end:.4g} {units.get('t', 's')}"
        )
        yield (
            f"{what} repeats {repeats}, although it varied before: did its sensor stop, or is it "
            "at the end of its range?"
        )


def _numb(
    what: str, times: Numbers, gap: Numbers, force: Numbers, other: Numbers, units: Mapping[str, str]
) -> Iterator[str]:
    """Yield that a pad feels nothing but its noise while the other one is loaded, and the gap has not opened.

    One that touches the object late does so for a while; one that felt it before and feels it again had failed.
    """
    known = np.isfinite(force) & np.isfinite(other)
    t, gap, force, other = times[known], gap[known], force[known], other[known]
    if len(force) < FEWEST:
        return
    low, span = usual_range(other)[0], float(np.ptp(other))
    noise = max(float(np.median(np.abs(np.diff(part, 2)))) for part in (force, other))
    loaded = other > low + 0.5 * span
    begin = int(loaded.argmax())
    free = np.flatnonzero(other[:begin] < low + FREE_GLITCH * span)
    if not len(free) or not span > GLITCH_NOISE * noise:
        return
    loaded &= gap <= gap[begin]
    zero = float(np.median(force[free]))
    numb = np.flatnonzero(loaded & (np.abs(force - zero) < max(GLITCH_NOISE * noise, NUMB * span)))
    felt = np.flatnonzero(np.abs(force - zero) > FREE * span)
    lost = numb[(numb > felt[0]) & (numb < felt[-1])] if len(felt) else felt
    if len(numb) < FEWEST or len(numb) <= NUMB_SHARE * np.count_nonzero(loaded):
        numb = lost
    if len(numb) > GLITCH_SAMPLES:
        yield (
            f"{what} stays at {zero:.3g} {units.get('force_left', 'N')} from {t[numb[0]]:.4g} to {t[numb[-1]]:.4g} "
            f"{units.get('t', 's')}, while the other pad feels up to {other[numb].max():.3g}: does its fingertip not "
            "answer, or did one finger alone touch?"
        )


def _unequal(left: Numbers, right: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that two pads do not bear the same force, or not all the time: as opposed pads they have to.

    Counts of two sensors need not be the same, but what they are of each other stays.
    """
    known = np.isfinite(left) & np.isfinite(right)
    left, right = left[known], right[known]
    if len(left) < FEWEST or not any(map(_is_clear, (left, right))):
        return
    left, right = (force - np.median(force[:ZERO_SAMPLES]) for force in (left, right))
    magnitude = np.abs(left) + np.abs(right)
    low, high = usual_range(magnitude)
    loaded = magnitude > low + 0.5 * (high - low)
    if np.count_nonzero(loaded) < FEWEST:
        return
    least, usual, most = np.quantile(
        right[loaded] / magnitude[loaded], (UNEQUAL_REST, 0.5, 1.0 - UNEQUAL_REST)
    )
    if most - least > UNEQUAL or (abs(usual - 0.5) > UNEQUAL and "force_left" not in units):
        yield (
            f"the right pad bears {100 * least:.0f} % to {100 * most:.0f} % of the force of both under load, and half "
            "is due: were the pads exchanged, does one read wrong, or did the object lie on one of them only in part?"
        )


def _parted(times: Numbers, left: Numbers, right: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that the forces of two loaded pads part at once: one failed or came back, or they were exchanged."""
    known = np.isfinite(left) & np.isfinite(right)
    t, left, right = times[known], left[known], right[known]
    if len(left) < FEWEST:
        return
    left, right = (force - np.median(force[:ZERO_SAMPLES]) for force in (left, right))
    low, high = usual_range((left + right) / 2.0)
    span = high - low
    loaded = np.minimum(left, right) > FREE * span
    if not loaded.any():
        return
    scale = float(np.median(left[loaded] / right[loaded]))
    steps = np.abs(np.diff(_course(left - scale * right, GLITCH_SAMPLES)))
    larger = np.maximum(left, right)
    # Where fingers meet an object, or let it go, one of them can be first.
    held = np.flatnonzero(larger > 0.5 * larger.max())
    begin, end = min(int(loaded.argmax()), int(held[0])), int(held[-1])
    within = (loaded[1:] | loaded[:-1]) & (np.arange(1, len(t)) > begin) & (np.arange(1, len(t)) < end)
    k = int(np.argmax(steps * within))
    least = max(PARTED * span, GLITCH_NOISE * float(np.median(steps)), JUMP * float(np.sort(steps)[-3]))
    if steps[k] > least and within[k]:
        yield (
            f"the forces of the pads part by {steps[k]:.3g} {units.get('force_left', 'N')} at {t[k + 1]:.4g} "
            f"{units.get('t', 's')}: did one of them fail for a while, or were they exchanged?"
        )


def _rough(what: str, times: Numbers, force: Numbers) -> Iterator[str]:
    """Yield that a force varies so much around its mean course, or has so coarse steps, that no value tells it."""
    low, high = usual_range(force)
    span, step_s = high - low, float(np.median(np.diff(times)))
    width = 2 * max(2, round(0.5 * ROUGH_S / step_s)) + 1
    if len(force) < 2 * width or not span > 0.0:
        return
    around = np.pad(force, width // 2, mode="edge")
    course = np.convolve(around, np.full(width, 1.0 / width), mode="valid")
    varies = float(np.median(np.abs(force - course)))
    apart = np.diff(np.unique(force))
    coarse = 0.5 * float(apart.min())
    in_steps = np.allclose(apart / (2.0 * coarse), np.round(apart / (2.0 * coarse)))
    if varies > ROUGH * span:
        share = f"{100 * varies / span:.0f} %"
        yield f"{what} varies by {share} of its range around its course, and so does each feature of it"
    elif in_steps and coarse > COARSE * span:
        share = f"{200 * coarse / span:.0f} %"
        yield f"{what} has steps of {share} of its range: each value is up to half a step off"


def _rises_at_once(times: Numbers, force: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that a force under a load rises within a sample, as where some are missing, or after its sensor stopped."""
    known = np.isfinite(force)
    t, force = times[known], force[known]
    if len(force) < FEWEST_IN_COURSE:
        return
    low, high = usual_range(force)
    steps = np.diff(_course(force, GLITCH_SAMPLES))
    free = np.flatnonzero(force <= low + FREE * (high - low))
    samples, usual = np.arange(len(steps)), float(np.sort(np.abs(steps))[-3])
    steps[samples - free[np.searchsorted(free, samples, side="right") - 1] < LOADED_SAMPLES] = 0.0
    k, noise = int(steps.argmax()), float(np.median(np.abs(np.diff(force, 2))))
    if steps[k] > max(PARTED * (high - low), GLITCH_NOISE * noise, JUMP * usual):
        yield (
            f"the force rises by {steps[k]:.3g} {units.get('force_left', 'N')} at once at {t[k + 1]:.4g} "
            f"{units.get('t', 's')}, under a load: are samples missing there, or did its sensor stop before?"
        )


def _is_clear(force: Numbers) -> bool:
    """Return whether a force is far above its noise."""
    return bool(np.ptp(force) > GLITCH_NOISE * np.median(np.abs(np.diff(force, 2))))


def _glitches(what: str, times: Numbers, force: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that a force leaves its course for a few samples: without a load, or by most of its range anywhere."""
    changes = np.flatnonzero(np.diff(force)) + 1
    # A sensor that is slower than the rows repeats its values.
    every = max(1, round(float(np.median(np.diff(changes))))) if len(changes) > 1 else 1
    sampled, sampled_times = force[::every], times[::every]
    if len(sampled) < FEWEST_IN_COURSE:
        return
    step_s = float(np.median(np.diff(sampled_times)))
    course = _course(sampled, min(GLITCH_SAMPLES, int(GLITCH_S / step_s)))
    apart, span = np.abs(sampled - course), float(np.ptp(sampled))
    free = course < course.min() + FREE_GLITCH * np.ptp(course)
    noise = float(np.median(apart))
    left = (apart > np.where(free, FREE_GLITCH, LOADED_GLITCH) * span) & (apart > GLITCH_NOISE * noise)
    # Under a load, nothing exceeds all other forces several times and then comes back, however rarely it is measured.
    wide = _course(sampled, min(FAR_SAMPLES, max(1, int(FAR_S / step_s))))
    loaded = wide > wide.min() + FREE_GLITCH * np.ptp(wide)
    far = np.abs(sampled - wide)
    left |= loaded & (far > max(FAR * float(np.ptp(wide)), GLITCH_NOISE * float(np.median(far))))
    count = int(left.sum())
    if not 0 < count <= MOST_GLITCHES * len(sampled):
        return
    k = int(np.argmax(left))
    others = f", and {count - 1} more" if count > 1 else ""
    yield (
        f"{what} leaves its course for a moment ({sampled[k]:.4g} {units.get('force_left', 'N')} at "
        f"{sampled_times[k]:.4g} s{others}): if that is a glitch, take it out, since it can "
        "pass for a contact"
    )


def _course(force: Numbers, longest: int) -> Numbers:
    """Return a force without what lasts at most so many samples."""
    around = np.pad(force, longest, mode="reflect")
    return np.median(np.lib.stride_tricks.sliding_window_view(around, 2 * longest + 1), axis=1)


def _seldom(what: str, times: Numbers, values: Numbers, large: float) -> Iterator[str]:
    """Yield that values are new so rarely (s) that they change by a `large` share of their range at once."""
    changes = np.flatnonzero(np.diff(values)) + 1
    if len(changes) < FEWEST_CHANGES:
        return
    every_s = float(np.quantile(np.diff(times[changes]), SELDOM_SHARE))
    rows = float(np.quantile(np.diff(changes), SELDOM_SHARE))
    largest = float(np.abs(np.diff(values)).max())
    if every_s >= SELDOM_S and rows >= SELDOM_ROWS and largest > large * np.ptp(values):
        yield (
            f"{what} has a new value every {every_s:.2g} s only, more rarely than the rows: a contact is seen up to so "
            "much too late, and a rest with an older value"
        )


def _drift(what: str, gap: Numbers, force: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that a force does not come back when the fingers are open again."""
    span = float(np.ptp(force))
    changes = np.flatnonzero(np.diff(force))
    if len(changes) < FEWEST:  # measured too rarely, unless its last value stays for longer than others did
        held = len(force) - 1 - int(changes[-1]) if len(changes) > 1 else 0
        if held <= max(FEWEST, USUAL_HOLDS * float(np.diff(changes).max(initial=0))):
            return
    ends = force[:ZERO_SAMPLES], force[-ZERO_SAMPLES:]
    steady = max(float(np.ptp(part)) for part in ends) <= STEADY * span
    first_load = int(np.argmax(force > force[0] + FREE * span))
    peak = int(force.argmax())
    opened = gap[-1] >= gap[first_load] and min(gap[0], gap[-1]) > gap[peak] + OPENED * np.ptp(gap)
    apart = float(ends[1].mean() - ends[0].mean())
    if steady and opened and abs(apart) > DRIFT * span:
        yield (
            f"{what} ends {apart:+.3g} {units.get('force_left', 'N')} from where it began, although the fingers are "
            "open again: its zero drifts, and all forces have a part of that, or its sensor stopped"
        )


def _bump(times: Numbers, gap: Numbers, force: Numbers, units: Mapping[str, str]) -> Iterator[str]:
    """Yield that a force comes, is gone while the gap (m) closes further, and comes back, by time (s)."""
    known = np.isfinite(force) & np.isfinite(gap)
    t_s, gap, force = times[known], gap[known], force[known]
    if len(force) < FEWEST_IN_COURSE:
        return
    course = _course(force, 1)
    low, span = usual_range(course)[0], float(np.ptp(course))
    contact = FREE_GLITCH * span if "force_left" in units else min(FREE_GLITCH * span, CONTACT_FORCE_N)
    contact = max(contact, GLITCH_NOISE * float(np.median(np.abs(np.diff(force, 2)))))
    felt = course - low > contact
    begin = int(felt.argmax())
    gone = np.flatnonzero(course[begin:] - low < 0.5 * contact)
    if not felt.any() or not len(gone):
        return
    end = begin + int(gone[0])
    back = np.flatnonzero(felt[end:])
    if not len(back):
        return
    again = end + int(back[0])
    closes = float(gap[end] - gap[again])
    glitch = end - begin <= GLITCH_SAMPLES and t_s[end] - t_s[begin] <= GLITCH_S
    if closes > BUMP_TRAVEL * np.ptp(gap) and gap[end:again].max() <= gap[begin] and not glitch:
        yield (
            f"a force comes at {t_s[begin]:.4g} s and is gone at {t_s[end]:.4g} s, the fingers close by "
            f"{closes * 1e3:.3g} mm more, and it comes back at {t_s[again]:.4g} s: the contact is the first of these. "
            "If the fingers touched something on their way, cut that out; or the object broke"
        )


def _late(what: str, times: Numbers, gap: Numbers, force: Numbers) -> Iterator[str]:
    """Yield that a force (N) stays while the fingers open, or that the gap (m) follows late, by time (s)."""
    known = np.isfinite(force) & np.isfinite(gap)
    t_s, gap, force = times[known], gap[known], force[known]
    if len(force) < FEWEST_IN_COURSE:
        return
    low, high = usual_range(force)
    loaded = np.flatnonzero(force > low + 0.5 * (high - low))
    free = np.flatnonzero(force < low + FREE_GLITCH * (high - low))
    if not len(loaded) or not len(onset := free[free < loaded[0]]) or not np.ptp(gap) > 0.0:
        return
    gone = free[free > loaded[-1]]
    begin, opened = int(onset[-1]), OPENS * float(np.ptp(gap))
    least_s = max(LATE_S, LATE_SAMPLES * float(np.median(np.diff(t_s))))
    wide = loaded[(gap[loaded] > gap[begin] + opened) & (loaded > loaded[gap[loaded].argmin()])]
    if len(wide) and len(gone) and t_s[wide[-1]] - t_s[wide[0]] > least_s:
        yield (
            f"{what} stays until {t_s[wide[-1]]:.4g} s, although the fingers are wider than at the contact from "
            f"{t_s[wide[0]]:.4g} s on: does the force come late, or did its sensor stop?"
        )
    elif len(gone):
        end, still = int(gone[0]), STILL * float(np.ptp(gap))
        opens = end + int((gap[end:] > gap[begin : end + 1].min() + still).argmax())
        late_s = float(t_s[opens] - t_s[end])
        around_s = t_s[begin] + late_s * np.arange(-1, 2)
        approach, further = -np.diff(np.interp(around_s, t_s, gap))
        closes = float(np.interp(t_s[end] - late_s, t_s, gap)) - gap[end] > GOES_ON * approach
        goes_on = further > GOES_ON * approach > still
        if late_s > least_s and around_s[0] >= t_s[0] and goes_on and not closes:
            yield (
                f"the fingers go on as fast after the force begins (at {t_s[begin]:.4g} s), and open {late_s:.2g} s "
                "after it is gone: does the gap come late?"
            )


def _jump(times: Numbers, gap: Numbers) -> Iterator[str]:
    """Yield that a gap (m) jumps faster (s) than fingers move, and farther than it does elsewhere."""
    known = np.isfinite(gap)
    t_s, steps = times[known], np.abs(np.diff(gap[known]))
    changes = np.flatnonzero(steps)
    if len(changes) < FEWEST:
        return
    k, usual = int(steps.argmax()), float(np.sort(steps)[-3])
    seconds = max(float(np.diff(t_s)[k]), float(np.median(np.diff(t_s))))
    # A gap that is measured more rarely than the rows moves in the time between its values.
    measured_s = max(seconds, float(np.median(np.diff(t_s[changes]))))
    faster = steps[k] > JUMP_SPEED_M_S * seconds or steps[k] - usual > JUMP_M_S2 * measured_s**2
    if faster and steps[k] > JUMP * usual:
        yield (
            f"the gap jumps by {steps[k] * 1e3:.3g} mm within {seconds * 1e3:.3g} ms (at {t_s[k + 1]:.4g} s), "
            "as no finger does: is it a glitch, or did its sensor stop before?"
        )


def _stopped_gap(times: Numbers, gap: Numbers, force: Numbers) -> Iterator[str]:
    """Yield that a gap (m) stays, by time (s), as the gap of a rigid object does, and yet does not end so.

    It jumps to another value at once, and the force does not. Or it does not open, and the force is gone.
    """
    begins = np.concatenate(([0], np.flatnonzero(np.diff(gap)) + 1, [len(gap)])).tolist()
    # The gap can have fewer values than rows.
    usual = int(np.median(np.diff(begins)))
    longest = max(FEWEST, USUAL_HOLDS * usual)
    changes = np.abs(np.diff(gap[begins[:-1]])).tolist()
    span = float(np.ptp(force))
    for k, (begin, end) in enumerate(pairwise(begins)):
        during = force[begin:end]
        if end - begin < longest or k == 0 or not float(np.ptp(during)) > FREE * span:
            continue
        stays = (
            f"the gap stays at {gap[begin] * 1e3:.4g} mm from {times[begin]:.4g} to {times[end - 1]:.4g} s"
        )
        if end == len(gap):
            if during.max() - force.min() > 0.5 * span and during[-1] - force.min() < FREE_GLITCH * span:
                yield f"{stays}, although the force is gone: did its sensor stop?"
        elif end + usual < len(gap):
            moves_on = end + longest > begins[k + 2] < len(gap)
            around = max(changes[k - 1], changes[k + 1] if moves_on else 0.0)
            across = force[max(begin, end - usual)], force[min(end + usual, len(force)) - 1]
            calm = abs(float(across[1] - across[0])) < FREE_GLITCH * span
            if changes[k] > JUMP * around and changes[k] > STOPPED_STEPS * min(changes) and calm:
                yield (
                    f"{stays} while the force changes, and then jumps by {changes[k] * 1e3:.3g} mm: did its sensor "
                    "stop?"
                )


def force_of_pads(left: Numbers, right: Numbers) -> dict[str, Numbers]:
    """Return the force of each pad by its name in a sentence; of both together where one stands for both."""
    if np.array_equal(left, right, equal_nan=True):
        return {"the force": left}
    return {"the force of the left pad": left, "the force of the right pad": right}


def _held(force: Numbers) -> slice | None:
    """Return the samples in which a force that varies also without a load, by its noise, repeats a value; else None.

    A value in coarse counts can stay within its step. It is told only if it stays to the end, and for long, or if it is
    the largest of a converter.
    """
    if len(force) < FEWEST:
        return None
    steps = np.diff(force)
    changed = steps != 0.0
    free = force[:-1] < force.min() + FREE * np.ptp(force)
    begins = np.concatenate(([0], np.flatnonzero(changed) + 1, [len(force)])).tolist()
    runs = [slice(begin, end) for begin, end in pairwise(begins)]
    for run in (runs[-1], max(runs, key=lambda run: run.stop - run.start)):
        others = free.copy()
        others[run.start : run.stop - 1] = False
        repeated = run.stop - run.start - 1
        if repeated >= FEWEST and force[run.start] == force.max() and force.max() in LARGEST_COUNTS:
            return run
        if not others.any() or repeated * changed[others].mean() < CHANGES:
            continue
        noise = steps[others & changed]
        turns = noise[1:] * noise[:-1] < 0.0  # noise goes up and down, and a force that is built up does not
        if len(turns) == 0 or turns.mean() < TURNS:
            continue
        large = np.abs(noise) > 1.5 * np.abs(steps[changed]).min()
        fine = (large[1:] & large[:-1] & turns).mean() > LARGE_TURNS
        if fine or (run is runs[-1] and repeated >= STOPPED * len(force)):
            return run
    return None
