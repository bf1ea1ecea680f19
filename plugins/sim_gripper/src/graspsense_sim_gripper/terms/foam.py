"""Foam and rubber: a force that stiffens as a power of the compression, and creeps."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.maxwell import Maxwell, MaxwellState, maxwell
from graspsense_sim_gripper.terms.term import Limit, LinearForm, Rate, Term, WorkingPoint


class Foam(NamedTuple):
    """A power law, `force_n` (d / `at_m`)^`exponent`, with two Maxwell arms beside it; an arm of 0 N/m is none."""

    force_n: float
    at_m: float
    exponent: float
    """1: a spring; sponges 1.5 to 3, as their cells close."""
    arm1_n_m: float = 0.0
    tau1_s: float = 1.0
    arm2_n_m: float = 0.0
    tau2_s: float = 1.0


class FoamState(NamedTuple):
    """The forces of the arms, N."""

    arm1: MaxwellState
    arm2: MaxwellState


def foam(
    params: Foam, state: FoamState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, FoamState]:
    """Return the force; the arms are springs and dampers on the compression, so that they never give work back."""
    # Odd in d, so that a search that strays below zero still finds its way back.
    force = params.force_n * (abs(d1) / params.at_m) ** params.exponent
    if d1 < 0.0:
        force = -force
    if params.arm1_n_m == 0.0 and params.arm2_n_m == 0.0:
        return force, state
    force1, arm1 = maxwell(Maxwell(params.arm1_n_m, params.tau1_s), state.arm1, d0, d1, h, v1)
    force2, arm2 = maxwell(Maxwell(params.arm2_n_m, params.tau2_s), state.arm2, d0, d1, h, v1)
    return force + force1 + force2, FoamState(arm1, arm2)


def rates(params: Foam, at: WorkingPoint) -> tuple[Rate, ...]:
    """Return the arms' 1 / tau."""
    arms = ((params.arm1_n_m, params.tau1_s), (params.arm2_n_m, params.tau2_s))
    return tuple(Rate("relaxes", 1.0 / tau) for stiffness, tau in arms if stiffness > 0.0)


def limits(params: Foam, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return it without its arms, each a damper or a spring by what is nearer."""
    spring = damper = 0.0
    for stiffness, tau in ((params.arm1_n_m, params.tau1_s), (params.arm2_n_m, params.tau2_s)):
        if tau > at.seconds:
            spring += stiffness
        else:
            damper += stiffness * tau
    bare = params._replace(arm1_n_m=0.0, arm2_n_m=0.0)
    return (Limit("without arms", bare, spring, damper),)


def linear(params: Foam) -> LinearForm | None:
    """Return the spring that it is with an exponent of 1 and no arms."""
    if params.exponent != 1.0 or params.arm1_n_m != 0.0 or params.arm2_n_m != 0.0:
        return None
    return LinearForm(params.force_n / params.at_m)


TERM = Term(
    name="foam",
    summary="power law with two Maxwell arms",
    params=Foam,
    law=foam,
    at_rest=FoamState(MaxwellState(0.0), MaxwellState(0.0)),
    rates=rates,
    limits=limits,
    linear=linear,
    positive=("at_m", "exponent", "tau1_s", "tau2_s"),
    stiffnesses=("force_n", "arm1_n_m", "arm2_n_m"),
)
