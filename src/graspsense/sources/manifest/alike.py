"""Whether some grasps of a file or of an object are unlike the others: as a zero, a gain or the clock changed.

What such grasps have alike is compared: how far apart samples are in time, how far the fingers open, which share of the
force each pad bears, and the force at a gap that all reach. Nothing in a single grasp shows that one of these is wrong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.core.values.signals import NO_GAP
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.sources.columns.channel_facts import usual_range
from graspsense.sources.columns.recording_notices import FEWEST, FREE, ZERO_SAMPLES, shares_under_load
from graspsense.sources.formats.table import Numbers

GRASPS: Final = 4
"""Fewest grasps of a file, or of an object, that are compared."""
MOST_COMPARED: Final = 100
"""Most grasps of a file that are compared with each other, and in memory at once."""
APART: Final = 4.0
"""Two groups of grasps are apart by so many times what those of each differ,"""
OPENING: Final = 0.05
SHARE: Final = 0.06
RATIO: Final = 1.4
"""and by this share of the range of the gap, this share of the force of both pads, or this ratio of forces or times."""


def compared(recordings: Sequence[Any], *, of_file: bool) -> list[Any]:
    """Return the recordings of a file, or of a data set, in their order; one unlike most others has a notice of it.

    Those of a data set are compared with those of the same object. Their files can have other rates, and begin with
    other gaps.
    """
    groups: dict[Any, list[int]] = {}
    for k, grasp in enumerate(recordings):
        if isinstance(grasp, LabelledRecording) and len(grasp.recording.readings) >= FEWEST:
            groups.setdefault(None if of_file else (grasp.label, grasp.instance), []).append(k)
    noticed = [*recordings]
    for group in groups.values():
        if len(group) >= GRASPS:
            told = _notices([recordings[k] for k in group], of_file=of_file)
            for k, texts in zip(group, told, strict=True):
                notices = dict.fromkeys((*recordings[k].notices, *texts))
                noticed[k] = evolve(recordings[k], notices=tuple(notices))
    return noticed


def _notices(grasps: Sequence[LabelledRecording], *, of_file: bool) -> list[list[str]]:
    """Return the notices of each grasp."""
    signals = [grasp.recording.columns("gap_m", "force_left_n", "force_right_n") for grasp in grasps]
    loaded = [shares_under_load(left, right) for _, left, right in signals]
    shares = [float(np.median(of_right)) if len(of_right) else math.nan for of_right in loaded]
    unlike = {"the right pad bears another share of the force": _apart(shares, SHARE)}
    if of_file:
        periods = [float(np.median(np.diff(grasp.recording.columns("t_s")[0]))) for grasp in grasps]
        unlike["the samples are further apart in time, or closer,"] = _apart(np.log(periods), math.log(RATIO))
    if of_file and not any(grasp.recording.units.get("gap") == NO_GAP for grasp in grasps):
        low, high = np.array([usual_range(gap) for gap, *_ in signals]).T
        unlike["the fingers open to another gap"] = _apart(high, OPENING * float(np.median(high - low)))
        if len({grasp.label for grasp in grasps}) == 1:
            forces = [_force_at(signal, float(low.max())) for signal in signals]
            unlike["the force is another one at the same gap"] = _apart(np.log(forces), math.log(RATIO))
    return [
        [
            f"{what} than in most grasps beside it: did a zero, a gain or the clock change, were the pads exchanged, "
            "or is it another object?"
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
