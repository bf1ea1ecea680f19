"""Foam and rubber: a force that stiffens as a power of the compression, and creeps."""

from __future__ import annotations

from typing import Final, NamedTuple

from graspsense_sim_gripper.scene.terms.maxwell import Maxwell, MaxwellState, maxwell
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint

LEAST_EXPONENT: Final = 0.2
MOST_EXPONENT: Final = 20.0


class Foam(NamedTuple):
    """A power law, `force_n` (d / `at_m`)^`exponent`, beside two Maxwell branches; a branch of 0 N/m is absent."""

    force_n: float
    at_m: float
    exponent: float
    """1 for a linear spring; 1.5 to 3 for sponges, whose cells close."""
    arm1_n_m: float = 0.0
    tau1_s: float = 1.0
    arm2_n_m: float = 0.0
    tau2_s: float = 1.0


class FoamState(NamedTuple):
    """The forces of the branches, N."""

    arm1_n: float
    arm2_n: float


def power(params: Foam, d: float) -> float:
    """Return the force (N) of the power law at a compression."""
    # Odd in d, so that a search that leaves the domain d >= 0 converges back to it.
    force: float = params.force_n * (abs(d) / params.at_m) ** params.exponent
    return force if d >= 0.0 else -force


def foam(
    params: Foam, state: FoamState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, FoamState]:
    """Return the force of the power law and the branches."""
    force = power(params, d1)
    if params.arm1_n_m == 0.0 and params.arm2_n_m == 0.0:
        return force, state
    force1, _ = maxwell(Maxwell(params.arm1_n_m, params.tau1_s), MaxwellState(state.arm1_n), d0, d1, h, v1)
    force2, _ = maxwell(Maxwell(params.arm2_n_m, params.tau2_s), MaxwellState(state.arm2_n), d0, d1, h, v1)
    return force + force1 + force2, FoamState(force1, force2)


def rates(params: Foam, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return 1 / tau of each branch."""
    arms = ((params.arm1_n_m, params.tau1_s), (params.arm2_n_m, params.tau2_s))
    return tuple(Rate("relaxes", 1.0 / tau) for stiffness, tau in arms if stiffness > 0.0)


def refusal(params: Foam) -> str:
    """Return why there is no law with this exponent."""
    if params.exponent > MOST_EXPONENT:
        return (
            f"exponent = {params.exponent:g} is too large, since the force then overflows within the width of an "
            f"object: at most {MOST_EXPONENT:g} (sponges have 1.5 to 3)"
        )
    if params.exponent < LEAST_EXPONENT:
        return (
            f"exponent = {params.exponent:g} is too small, since the force then jumps at the first touch, where no "
            f"step resolves it: at least {LEAST_EXPONENT:g} (sponges have 1.5 to 3)"
        )
    return ""


TERM = Term(
    name="foam",
    summary="power law with two Maxwell branches",
    params=Foam,
    law=foam,
    at_rest=FoamState(0.0, 0.0),
    rates=rates,
    refusal=refusal,
    positive=("at_m", "exponent", "tau1_s", "tau2_s"),
    stiffnesses=("force_n", "arm1_n_m", "arm2_n_m"),
)
