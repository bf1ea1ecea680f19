"""What looks wrong in the forces of a recording, whatever it was read from."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve

from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]

FEWEST: Final = 20
"""Fewest samples from which on a force that has stopped is told from one that is steady."""
STOPPED: Final = 0.1
"""Share of a recording for which a force in coarse counts repeats its last value when its sensor has stopped."""
CHANGES: Final = 20.0
"""Number of changes that a force would have had in the time in which its sensor has stopped."""
TURNS: Final = 0.3
"""Share of the changes without a load that go against the one before, where they are noise."""
LARGE_TURNS: Final = 0.1
"""Share of the changes without a load that turn and exceed the least one, where the steps of a force are fine."""
FREE: Final = 0.2
"""Share of its range up to which a force is that of free fingers."""


def with_notices(labelled: LabelledRecording) -> LabelledRecording:
    """Return the recording with all that looks wrong: what its reader noticed, and what its forces show.

    The recording itself has it too, so that a replay and a stored trial tell it.
    """
    notices = (*labelled.notices, *labelled.recording.notices, *force_notices(labelled.recording))
    notices = tuple(dict.fromkeys(notices))
    return evolve(labelled, notices=notices, recording=evolve(labelled.recording, notices=notices))


def force_notices(recording: Recording) -> Iterator[str]:
    """Return what looks wrong in the forces of the pads: no number, one value all along, or a value that stays."""
    unit = recording.units.get("t", "s")
    times = np.array([reading.frame.t_s for reading in recording.readings])
    for what, force in _pads(recording).items():
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
                else f"one value from {begin:.4g} to {end:.4g} {unit}"
            )
            yield (
                f"{what} repeats {repeats}, although it varied before: did its sensor stop, or is it "
                "at the end of its range?"
            )


def _pads(recording: Recording) -> dict[str, Numbers]:
    """Return the force of each pad by its name in a sentence; of both together where one stands for both."""
    left = np.array([reading.frame.force_left_n for reading in recording.readings])
    right = np.array([reading.frame.force_right_n for reading in recording.readings])
    if np.array_equal(left, right, equal_nan=True):
        return {"the force": left}
    return {"the force of the left pad": left, "the force of the right pad": right}


def _held(force: Numbers) -> slice | None:
    """Return the samples in which a force that varies also without a load, by its noise, repeats a value; else None.

    A value in coarse counts can stay within its step. It is told only if it stays to the end, and for long.
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
