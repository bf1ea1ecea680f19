"""Liquid that is pressed up the neck of an open container."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense.simulator_api import STANDARD_GRAVITY_M_S2
from graspsense_sim_gripper.scene.terms.oscillator import Forcing, OscillatorState, moved
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint


class Liquid(NamedTuple):
    """A wall that displaces `area_m2` per metre of compression presses liquid up a neck, in series with its own bulge.

    Expressed at the compression, the column in the neck is a mass rho L A^2 / A_n on a spring rho g A^2 / A_n and a
    damper 8 pi mu L A^2 / A_n^2 (Poiseuille), in series with the spring A^2 / C_w of the bulge.
    """

    area_m2: float
    neck_m2: float
    column_m: float
    """Length L of the liquid column in the neck."""
    bulge_m3_pa: float
    density_kg_m3: float = 1000.0
    viscosity_pa_s: float = 1e-3


class _AtCompression(NamedTuple):
    mass_kg: float
    k_n_m: float
    damping_n_s_m: float
    wall_n_m: float


def _seen(params: Liquid) -> _AtCompression:
    area, neck, column, bulge, density, viscosity = params
    ratio = area * area / neck
    return _AtCompression(
        density * column * ratio,
        density * STANDARD_GRAVITY_M_S2 * ratio,
        8.0 * math.pi * viscosity * column * ratio / neck,
        area * area / bulge,
    )


def liquid(
    params: Liquid, state: OscillatorState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, OscillatorState]:
    """Return the force of the pressure on the wall; exact if the rate of compression changes linearly."""
    mass, k, damping, wall = _seen(params)
    if h > 0.0:
        pull = wall / mass
        mean = (d1 - d0) / h
        forcing = Forcing(pull * d0, pull * (2.0 * mean - v1), pull * (v1 - mean) / h)
        state = moved(state, 0.5 * damping / mass, (k + wall) / mass, forcing, h)
    return wall * (d1 - state.y_m), state


def rates(params: Liquid, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the natural frequency of the column behind the wall, and the decay rate of its motion."""
    mass, k, damping, wall = _seen(params)
    return (Rate("swings", math.sqrt((k + wall) / mass)), Rate("relaxes", 0.5 * damping / mass))


TERM = Term(
    name="liquid",
    summary="liquid pressed up a neck: weight, viscosity and inertia, in series with the bulge of the wall",
    params=Liquid,
    law=liquid,
    at_rest=OscillatorState(0.0, 0.0),
    rates=rates,
    positive=("area_m2", "neck_m2", "column_m", "bulge_m3_pa", "density_kg_m3"),
)
