"""Snap-through of a thin shell."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.term import Term, no_rates


class Snap(NamedTuple):
    """A bistable shell: rises with k1 to the critical compression, falls by `drop_n` within `fall_m`, rises with k2.

    A drop of more than k1 times the critical compression leaves the shell dented when the fingers open.
    """

    k1_n_m: float
    critical_m: float
    drop_n: float
    fall_m: float
    k2_n_m: float


class SnapState(NamedTuple):
    """The part of the characteristic: 0 below the critical compression, 1 on the falling part, 2 beyond it."""

    part: int


def snap(
    params: Snap, state: SnapState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, SnapState]:
    """Return the force of the shell, which is piecewise linear in three parts.

    If the falling part is steeper than the stiffness of the pads, the shell jumps across it.
    """
    k1, critical, drop, fall, k2 = params
    if d1 <= critical:
        return k1 * d1, SnapState(0)
    peak = k1 * critical
    if d1 < critical + fall:
        return peak - drop * (d1 - critical) / fall, SnapState(1)
    return peak - drop + k2 * (d1 - critical - fall), SnapState(2)


def phase(state: SnapState) -> int:
    """Return the part of the characteristic."""
    return state.part


TERM = Term(
    name="snap",
    summary="bistable shell: a falling branch from a critical compression on",
    params=Snap,
    law=snap,
    at_rest=SnapState(0),
    rates=no_rates,
    phase=phase,
    positive=("k1_n_m", "fall_m", "k2_n_m"),
    stiffnesses=("k1_n_m", "k2_n_m", "drop_n"),
)
