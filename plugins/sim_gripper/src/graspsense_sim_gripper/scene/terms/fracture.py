"""A fracture: the object breaks permanently, at a force or at a compression."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.term import Term, no_force, no_rates


class Fracture(NamedTuple):
    """The object breaks where the sum of its other terms exceeds `force_n`, or its compression `compression_m`.

    From then on it bears the fraction `left` of that sum. The break is located within the tick. An object has at most
    one such term.
    """

    force_n: float = math.inf
    compression_m: float = math.inf
    left: float = 0.0


class FractureState(NamedTuple):
    """Whether the object has broken (0 or 1)."""

    broken: int


def fracture(
    params: Fracture, state: FractureState, force_n: float, d1: float
) -> tuple[float, FractureState]:
    """Return the force of the object; breaking takes effect after the step, which ends there (`phase`)."""
    if state.broken == 1:
        return params.left * force_n, state
    if force_n > params.force_n or d1 > params.compression_m:
        return force_n, FractureState(1)
    return force_n, state


def phase(state: FractureState) -> int:
    """Return whether the object has broken."""
    return state.broken


def refusal(params: Fracture) -> str:
    """Return why there is no such fracture."""
    if params.force_n == math.inf and params.compression_m == math.inf:
        return "give force_n or compression_m, at which the object breaks"
    if params.left > 1.0:
        return f"left = {params.left:g} must be at most 1: an object bears no more after it has broken"
    return ""


TERM = Term(
    name="fracture",
    summary="the object breaks at a force or compression, and bears a fraction of its force from then on",
    params=Fracture,
    law=no_force,
    on_sum=fracture,
    at_rest=FractureState(0),
    rates=no_rates,
    phase=phase,
    positive=("force_n", "compression_m"),
    refusal=refusal,
)
