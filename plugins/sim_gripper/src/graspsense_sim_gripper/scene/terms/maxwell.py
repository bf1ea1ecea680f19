"""A viscoelastic (Maxwell) branch."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.phi import phi1, phi_ramp
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint


class Maxwell(NamedTuple):
    """A viscoelastic branch: a spring k in series with a damper k tau."""

    k_n_m: float
    tau_s: float


class MaxwellState(NamedTuple):
    """The force of the branch."""

    force_n: float


def maxwell(
    params: Maxwell, state: MaxwellState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, MaxwellState]:
    """Return the force q of q' = k d' - q / tau; exact if the rate of compression changes linearly."""
    x = h / params.tau_s
    decay = math.exp(-x)
    late = phi_ramp(x, decay)
    force = state.force_n * decay + params.k_n_m * ((d1 - d0) * (phi1(x, decay) - late) + h * v1 * late)
    return force, MaxwellState(force)


def rates(params: Maxwell, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return 1 / tau."""
    return (Rate("relaxes", 1.0 / params.tau_s),)


TERM = Term(
    name="maxwell",
    summary="viscoelastic branch, q' = k d' - q / tau",
    params=Maxwell,
    law=maxwell,
    at_rest=MaxwellState(0.0),
    rates=rates,
    positive=("tau_s",),
    stiffnesses=("k_n_m",),
)
