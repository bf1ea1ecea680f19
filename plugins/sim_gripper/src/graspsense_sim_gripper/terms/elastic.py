"""An elastic shell."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import Limit, LinearForm, NoState, Term, WorkingPoint


class Elastic(NamedTuple):
    """An elastic shell: force k1 d + k3 d^3."""

    k1_n_m: float
    k3_n_m3: float = 0.0


def stiffened(params: Elastic, d: float) -> float:
    """Return the cubic part of the force (N) at a compression."""
    return params.k3_n_m3 * d * d * d


def elastic(
    params: Elastic, state: NoState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, NoState]:
    """Return the force of the shell."""
    return params.k1_n_m * d1 + stiffened(params, d1), state


def limits(params: Elastic, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return the linear spring k1, the limit of small compressions."""
    return (Limit("spring", spring_n_m=params.k1_n_m),)


def linear(params: Elastic) -> LinearForm | None:
    """Return the spring k1; None if the shell stiffens (k3 > 0)."""
    return LinearForm(params.k1_n_m) if params.k3_n_m3 == 0.0 else None


TERM = Term(
    name="elastic",
    summary="elastic shell, k1 d + k3 d^3",
    params=Elastic,
    law=elastic,
    limits=limits,
    linear=linear,
    stiffnesses=("k1_n_m", "k3_n_m3"),
)
