"""What looks wrong in the forces of a recording, whatever it was read from."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording

FEWEST: Final = 20
"""Fewest samples from which on a force that has stopped is told from one that is steady."""
STOPPED: Final = 0.1
"""Share of a recording for which a force repeats its last value when its sensor has stopped,"""
CHANGES: Final = 20.0
"""and the number of changes that it would have had in this time."""
FREE: Final = 0.2
"""Share of its range up to which a force is that of free fingers."""


def with_notices(labelled: LabelledRecording) -> LabelledRecording:
    """Return the recording with all that looks wrong: what its reader noticed, and what its forces show."""
    notices = (*labelled.notices, *labelled.recording.notices, *force_notices(labelled.recording))
    return evolve(labelled, notices=tuple(dict.fromkeys(notices)))


def force_notices(recording: Recording) -> Iterator[str]:
    """Return what looks wrong in the forces of the pads: no number, one value all along, or a value that stays."""
    pads = {
        "left": np.array([reading.frame.force_left_n for reading in recording.readings]),
        "right": np.array([reading.frame.force_right_n for reading in recording.readings]),
    }
    if np.array_equal(pads["left"], pads["right"], equal_nan=True):
        pads = {"": pads["left"]}
    for side, force in pads.items():
        what = f"the force of the {side} pad" if side else "the force"
        known = force[np.isfinite(force)]
        if len(force) > 1 and not len(known):
            yield f"{what} has no number: was the sensor connected?"
        elif len(known) > 2 and known.min() == known.max():
            yield f"{what} does not change during the recording: is it another column, or did its sensor stop?"
        elif _stops(known):
            yield (
                f"{what} repeats its last value to the end, although it varied before: did its sensor stop, or is it "
                "at the end of its range?"
            )


def _stops(force: NDArray[np.float64]) -> bool:
    """Return whether a force that varies also without a load, by its noise, repeats its last value to the end."""
    if len(force) < FEWEST:
        return False
    changed = np.diff(force) != 0.0
    until = int(np.flatnonzero(changed)[-1]) + 1
    free = force < force.min() + FREE * np.ptp(force)
    earlier = changed[:until]
    usual = float(earlier.mean())
    noise = earlier[free[:until]]
    repeated = len(changed) - until
    return bool(
        len(noise)
        and noise.mean() > 0.5 * usual
        and repeated >= STOPPED * len(force)
        and repeated * usual >= CHANGES
    )
