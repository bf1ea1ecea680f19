"""Sloshing: liquid that keeps oscillating after the wall has moved."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.oscillator import Forcing, OscillatorState, moved
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint


class Slosh(NamedTuple):
    """One lightly damped mode: a mass that is attached to the wall by a spring and a damper only."""

    mass_kg: float
    """Mass of the mode, expressed at the compression."""
    frequency_hz: float
    damping_ratio: float = 0.0


def slosh(
    params: Slosh, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the force of the mode, exact if the rate of compression changes linearly.

    z = d - y follows z'' + 2 a z' + w2 z = d''.
    """
    w = 2.0 * math.pi * params.frequency_hz
    a, square = params.damping_ratio * w, w * w
    if h > 0.0:
        mean = (d1 - d0) / h
        start = OscillatorState(d0 - state.y_m, 2.0 * mean - v1 - state.v_m_s)
        between = moved(start, a, square, Forcing(2.0 * (v1 - mean) / h, 0.0, 0.0), h)
        state = OscillatorState(d1 - between.y_m, v1 - between.v_m_s)
    return params.mass_kg * (square * (d1 - state.y_m) + 2.0 * a * (v1 - state.v_m_s)), state


def rates(params: Slosh, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the frequency and the decay rate of the mode."""
    w = 2.0 * math.pi * params.frequency_hz
    return (Rate("swings", w), Rate("relaxes", params.damping_ratio * w))


TERM = Term(
    name="slosh",
    summary="lightly damped mode of the contents, attached to the wall",
    params=Slosh,
    law=slosh,
    at_rest=OscillatorState(0.0, 0.0),
    rates=rates,
    positive=("mass_kg", "frequency_hz"),
)
