"""Whether some grasps of a file or of an object are unlike the others: as a zero, a gain or the clock changed.

What such grasps have alike is compared: how far apart samples are in time, how far the fingers open, which share of the
force each pad bears, and the force at a gap that all reach. Nothing in a single grasp shows that one of these is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.core.values.signals import NO_GAP
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.sources.columns.channel_facts import usual_range
from graspsense.sources.columns.recording_notices import FEWEST, FREE, ZERO_SAMPLES, shares_under_load
from graspsense.sources.formats.table import Numbers

GRASPS: Final = 4
"""Fewest grasps of a file that are compared."""
MOST_COMPARED: Final = 100
"""Most grasps of a file that are compared with each other, and in memory at once."""
APART: Final = 4.0
"""Two groups of grasps are apart by so many times what those of each differ,"""
OPENING: Final = 0.05
SHARE: Final = 0.06
RATIO: Final = 1.4
"""and by this share of the range of the gap, this share of the force of both pads, or this ratio of forces or times."""
EXCHANGED: Final = 0.03
"""Least difference of shares that are those of exchanged pads,"""
ALIKE: Final = 0.3
"""and share of a difference by which two that belong together differ at most."""
SHARES: Final = "the right pad bears another share of the force"


def compared(
    recordings: Sequence[LabelledRecording | UnreadableRecording],
) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield the recordings of a file in their order; one that is unlike most others has a notice of it."""
    known = _long_enough(recordings)
    told = _notices([*known.values()]) if len(known) >= GRASPS else [[]] * len(known)
    yield from _noticed(recordings, dict(zip(known, told, strict=True)))


def compared_by_label(recordings: Sequence[LabelledRecording]) -> list[LabelledRecording]:
    """Return the recordings of a data set; one that is unlike most others of the same object has a notice of it.

    They can be from different files, which may have other rates, and begin with other gaps.
    """
    groups: dict[Any, list[int]] = {}
    for k, grasp in _long_enough(recordings).items():
        units = tuple(sorted(grasp.recording.units.items()))
        groups.setdefault((grasp.label, grasp.instance, units), []).append(k)
    told: dict[int, list[str]] = {}
    for group in groups.values():
        grasps = [recordings[k] for k in group]
        if len(grasps) >= GRASPS:
            unlike = {SHARES: _other_shares(_signals(grasps))}
            told |= zip(group, _told(unlike, "of the same label"), strict=True)
    return list(_noticed(recordings, told))


def _long_enough(
    recordings: Sequence[LabelledRecording | UnreadableRecording],
) -> dict[int, LabelledRecording]:
    return {
        k: recording
        for k, recording in enumerate(recordings)
        if isinstance(recording, LabelledRecording) and len(recording.recording.readings) >= FEWEST
    }


def _noticed(recordings: Sequence[Any], told: Mapping[int, list[str]]) -> Iterator[Any]:
    for k, recording in enumerate(recordings):
        new = [text for text in told.get(k, ()) if text not in recording.notices]
        yield evolve(recording, notices=(*recording.notices, *new)) if new else recording


def _signals(grasps: Sequence[LabelledRecording]) -> list[Numbers]:
    return [grasp.recording.columns("gap_m", "force_left_n", "force_right_n") for grasp in grasps]


def _told(unlike: Mapping[str, NDArray[np.bool_]], others: str) -> list[list[str]]:
    """Return the notices of each grasp, from those in which something is `unlike` in `others`."""
    ends = (
        f"than in most grasps {others}: did a zero, a gain or the clock change, were the pads exchanged, or is it "
        "another object?"
    )
    each = zip(*unlike.values(), strict=True)
    return [[f"{what} {ends}" for what, other in zip(unlike, told, strict=True) if other] for told in each]


def _notices(grasps: Sequence[LabelledRecording]) -> list[list[str]]:
    """Return the notices of each grasp of a file."""
    signals = _signals(grasps)
    periods = [float(np.median(np.diff(grasp.recording.columns("t_s")[0]))) for grasp in grasps]
    unlike = {
        "the samples are further apart in time, or closer,": _apart(np.log(periods), math.log(RATIO)),
        SHARES: _other_shares(signals),
    }
    if not any(grasp.recording.units.get("gap") == NO_GAP for grasp in grasps):
        low, high = np.array([usual_range(gap) for gap, *_ in signals]).T
        unlike["the fingers open to another gap"] = _apart(high, OPENING * float(np.median(high - low)))
        if len({grasp.label for grasp in grasps}) == 1:
            forces = [_force_at(signal, float(low.max())) for signal in signals]
            unlike["the force is another one at the same gap"] = _apart(np.log(forces), math.log(RATIO))
    return _told(unlike, "of the file")


def _other_shares(signals: Sequence[Numbers]) -> NDArray[np.bool_]:
    """Return in which grasps the pads bear other shares of the force; also by less, if these are exchanged."""
    loaded = [shares_under_load(left, right) for _, left, right in signals]
    shares = np.array([float(np.median(of_right)) if len(of_right) else math.nan for of_right in loaded])
    other, least = _apart(shares, SHARE), _apart(shares, EXCHANGED)
    if other.any() or min(least.sum(), (~least).sum()) < 2:
        return other
    of_some, of_most = float(shares[least].mean()), float(shares[~least].mean())
    exchanged = abs(of_some + of_most - 1.0) < ALIKE * abs(of_some - of_most)
    return least & exchanged


def _force_at(signal: Numbers, gap: float) -> float:
    """Return the force of both pads when the fingers have closed to a gap, NaN if it is small there."""
    force = signal[1] + signal[2]
    force = force - np.median(force[:ZERO_SAMPLES])
    reached = float(force[int((signal[0] <= gap).argmax())])
    return reached if reached > FREE * force.max() > 0.0 else math.nan


def _apart(values: Sequence[float] | Numbers, least: float) -> NDArray[np.bool_]:
    """Return which values are in the smaller of two groups that are far apart; of equal ones, in the later group."""
    every = np.array(values)
    ordered = np.sort(every)
    steps = np.diff(ordered)
    if not np.isfinite(every).all():
        return np.zeros(len(every), dtype=np.bool_)
    k = int(steps.argmax())
    differ = max(ordered[k] - ordered[0], ordered[-1] - ordered[k + 1])
    above = every > ordered[k]
    smaller = above if above.sum() + above[0] <= len(above) / 2 else ~above
    apart: NDArray[np.bool_] = smaller & bool(steps[k] > max(least, APART * differ))
    return apart
