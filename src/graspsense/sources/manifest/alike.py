"""Whether some of the grasps of a file are unlike the others, as where a zero, a gain or the clock changed in between.

What such grasps have alike is compared: how far apart samples are in time, how far the fingers open, which share of the
force each pad bears, and the force at a gap that all reach. Nothing in a single grasp shows that one of these is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final

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


def compared(
    recordings: Sequence[LabelledRecording | UnreadableRecording],
) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield the recordings of a file in their order; one that is unlike most others has a notice of it."""
    known = {
        k: recording
        for k, recording in enumerate(recordings)
        if isinstance(recording, LabelledRecording) and len(recording.recording.readings) >= FEWEST
    }
    told = dict(zip(known, _notices([*known.values()]), strict=True)) if len(known) >= GRASPS else {}
    for k, recording in enumerate(recordings):
        yield evolve(known[k], notices=(*known[k].notices, *told[k])) if told.get(k) else recording


def _notices(grasps: Sequence[LabelledRecording]) -> list[list[str]]:
    """Return the notices of each grasp."""
    signals = [grasp.recording.columns("gap_m", "force_left_n", "force_right_n") for grasp in grasps]
    periods = [float(np.median(np.diff(grasp.recording.columns("t_s")[0]))) for grasp in grasps]
    loaded = [shares_under_load(left, right) for _, left, right in signals]
    shares = [float(np.median(of_right)) if len(of_right) else math.nan for of_right in loaded]
    unlike = {
        "the samples are further apart in time, or closer,": _apart(np.log(periods), math.log(RATIO)),
        "the right pad bears another share of the force": _apart(shares, SHARE),
    }
    if not any(grasp.recording.units.get("gap") == NO_GAP for grasp in grasps):
        low, high = np.array([usual_range(gap) for gap, *_ in signals]).T
        unlike["the fingers open to another gap"] = _apart(high, OPENING * float(np.median(high - low)))
        if len({grasp.label for grasp in grasps}) == 1:
            forces = [_force_at(signal, float(low.max())) for signal in signals]
            unlike["the force is another one at the same gap"] = _apart(np.log(forces), math.log(RATIO))
    return [
        [
            f"{what} than in most grasps of the file: did a zero, a gain or the clock change, or is it another object?"
            for what, which in unlike.items()
            if which[k]
        ]
        for k in range(len(grasps))
    ]


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
