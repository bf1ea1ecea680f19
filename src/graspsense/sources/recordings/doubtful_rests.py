"""Rests of recorded squeezes that are doubtful: most of the squeeze comes after them, or the gap is too coarse."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from graspsense.core.components.caller import set_option
from graspsense.core.grasp.gap_resolution import gap_resolution
from graspsense.core.values.errors import counted
from graspsense.core.values.features import Features
from graspsense.recording.replayable import Recording

MOST_TRAVEL: Final = 0.5
"""Share of the travel of a squeeze after a rest, and"""
PRESSED: Final = 2.0
"""ratio of a later force to that of the rest, from which on most of the squeeze comes after it."""
RIGID: Final = 0.01
PRESSED_RIGID: Final = 1.4
LOST: Final = 10.0
"""Share of its range by which the gap closes at most on a rigid object, whose squeeze is that of the force alone, the
same ratio there, and that of the force in the same gap to one that is gone."""
UNCERTAIN: Final = 0.2
"""Share of `delta_t` from which on the time of the last step of the gap makes it uncertain."""


def notices_of_rests(grasps: Sequence[tuple[Features, Recording]], role: str) -> list[str]:
    """Return what looks wrong in the rests of grasps with these features, whose settings are those of a `role`."""
    told = {
        "most of a squeeze, or much of its force, comes after the rest that p_steady, f_steady and delta_t are of. "
        "If the fingers only stuck there, or a sensor stopped, ask for a longer rest: "
        f"{set_option(f'{role}.rest_window_s=SECONDS')}": presses_on,
        "the gap has coarse steps, and stays for a large part of delta_t before the last one: the fingers go on "
        "within a step for as long and longer, so delta_t is too small, and cannot be told": rests_within_a_step,
    }
    counts = {what: sum(doubts(*grasp) for grasp in grasps) for what, doubts in told.items()}
    return [f"{count} of {counted(len(grasps), 'grasp')}: {what}" for what, count in counts.items() if count]


def presses_on(features: Features, recording: Recording) -> bool:
    """Return whether most of a squeeze comes after its rest, as it does if the fingers stick on their way.

    A gap that shows no travel after the rest, nor before it, tells of no rest either. Nor is there one of a squeeze
    where the force is gone, and the gap is what it was.
    """
    known = dict(zip(features.names, features.values, strict=True))
    p_first, p_steady, f_steady = (known.get(name, math.nan) for name in ("p_first", "p_steady", "f_steady"))
    gap, left, right = recording.columns("gap_m", "force_left_n", "force_right_n")
    later, both = gap <= p_steady, (left + right) / 2.0
    if not later.any():  # also without a rest, or without a gap
        return False
    narrowest, force = gap[later].min(), np.fmax.reduce(both[later])
    still = RIGID * (np.fmax.reduce(gap) - narrowest)
    lost = np.fmax.reduce(both[np.abs(gap - p_steady) <= still], initial=0.0) > LOST * max(f_steady, 0.0)
    travels_on = p_steady - narrowest >= MOST_TRAVEL * (p_first - narrowest)
    pressed = PRESSED_RIGID if p_first - narrowest < still else PRESSED if travels_on else math.inf
    return bool(lost or force > pressed * f_steady)


def rests_within_a_step(features: Features, recording: Recording) -> bool:
    """Return whether a coarse gap stays for much of `delta_t` before its last step to the rest.

    Fingers that slow down are then still within the next step for as long as that.
    """
    known = dict(zip(features.names, features.values, strict=True))
    delta_t, p_steady = (known.get(name, math.nan) for name in ("delta_t", "p_steady"))
    t_s, gap = recording.columns("t_s", "gap_m")
    reached = gap <= p_steady
    if not (delta_t >= 0.0 and reached.any()) or {"t", "gap"} & recording.units.keys():
        return False
    resting = int(reached.argmax())
    steps = np.flatnonzero(np.diff(gap[:resting])) + 1
    last = int(steps[-1]) if len(steps) else 0
    coarse = resting - last > 1 and gap_resolution(t_s.tolist(), gap.tolist(), resting).step_m > 0.0
    return coarse and min(float(t_s[resting] - t_s[last]), delta_t) >= UNCERTAIN * delta_t
