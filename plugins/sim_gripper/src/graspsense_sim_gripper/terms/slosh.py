"""Liquid that goes on swinging after the wall has moved."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.terms.oscillator import Motion, moved
from graspsense_sim_gripper.terms.term import Rate, Term, WorkingPoint


class Slosh(NamedTuple):
    """One lightly damped mode: a mass that hangs on the wall by a spring and a damper and is held by nothing else."""

    mass_kg: float
    """As seen at the compression."""
    frequency_hz: float
    damping_ratio: float = 0.0


def slosh(params: Slosh, state: Motion, d0: float, d1: float, h: float) -> tuple[float, Motion]:
    """Return the force with which the mass hangs back; exact for a straight path."""
    w = 2.0 * math.pi * params.frequency_hz
    a, square = params.damping_ratio * w, w * w
    speed = (d1 - d0) / h if h > 0.0 else 0.0
    if h > 0.0:
        state = moved(state, a, square, square * d0 + 2.0 * a * speed, square * speed, h)
    return params.mass_kg * (square * (d1 - state.y_m) + 2.0 * a * (speed - state.v_m_s)), state


def rates(params: Slosh, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the mode's frequency and how fast it dies out."""
    w = 2.0 * math.pi * params.frequency_hz
    return (Rate("swings", w), Rate("relaxes", params.damping_ratio * w))


TERM = Term(
    name="slosh",
    summary="lightly damped mode of the contents that hangs on the wall",
    params=Slosh,
    law=slosh,
    at_rest=Motion(0.0, 0.0),
    rates=rates,
    positive=("mass_kg", "frequency_hz"),
)
