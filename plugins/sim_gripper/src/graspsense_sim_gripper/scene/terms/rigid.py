"""A rigid body, which may break."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.term import Term, no_rates


class Rigid(NamedTuple):
    """A rigid body with a Hertz contact, K d^1.5; above the crush force it breaks permanently."""

    hertz_n_m15: float
    crush_force_n: float = math.inf
    broken_n_m: float = 0.0
    """Stiffness after it has broken."""


class RigidState(NamedTuple):
    """Whether it has broken (0 or 1)."""

    broken: int


def hertz(params: Rigid, d: float) -> float:
    """Return the force (N) of the contact at a compression."""
    # Odd in d, so that a search that leaves the domain d >= 0 converges back to it.
    return params.hertz_n_m15 * d * math.sqrt(abs(d))


def rigid(
    params: Rigid, state: RigidState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, RigidState]:
    """Return the contact force; breaking takes effect after the step, which ends there (`phase`)."""
    if state.broken == 1:
        return params.broken_n_m * d1, state
    force = hertz(params, d1)
    if force > params.crush_force_n:
        return force, RigidState(1)
    return force, state


def phase(state: RigidState) -> int:
    """Return whether it has broken."""
    return state.broken


TERM = Term(
    name="rigid",
    summary="rigid body with a Hertz contact, K d^1.5; breaks above its crush force",
    params=Rigid,
    law=rigid,
    at_rest=RigidState(0),
    rates=no_rates,
    phase=phase,
    positive=("hertz_n_m15",),
    stiffnesses=("hertz_n_m15", "crush_force_n"),
)
