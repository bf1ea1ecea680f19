"""Snap-through of a thin shell."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import NoState, Term


class Snap(NamedTuple):
    """A bistable shell: rises with k1 to the critical compression, falls by `drop_n` within `fall_m`, rises with k2.

    A drop of more than k1 times the critical compression leaves the shell dented when the fingers open.
    """

    k1_n_m: float
    critical_m: float
    drop_n: float
    fall_m: float
    k2_n_m: float


def snap(params: Snap, state: NoState, d0: float, d1: float, h: float, v1: float) -> tuple[float, NoState]:
    """Return the force of the shell, which is piecewise linear in three parts.

    If the falling part is steeper than the stiffness of the pads, the shell jumps across it.
    """
    k1, critical, drop, fall, k2 = params
    if d1 <= critical:
        return k1 * d1, state
    peak = k1 * critical
    if d1 < critical + fall:
        return peak - drop * (d1 - critical) / fall, state
    return peak - drop + k2 * (d1 - critical - fall), state


TERM = Term(
    name="snap",
    summary="bistable shell: a falling branch from a critical compression on",
    params=Snap,
    law=snap,
    positive=("k1_n_m", "fall_m", "k2_n_m"),
    stiffnesses=("k1_n_m", "k2_n_m", "drop_n"),
)
