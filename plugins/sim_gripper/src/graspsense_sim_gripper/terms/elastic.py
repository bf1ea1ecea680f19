"""An elastic shell."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import NoState, Term


class Elastic(NamedTuple):
    """An elastic shell: force k1 d + k3 d^3."""

    k1_n_m: float
    k3_n_m3: float = 0.0


def elastic(params: Elastic, state: NoState, d0: float, d1: float, h: float) -> tuple[float, NoState]:
    """Return the shell's force."""
    return params.k1_n_m * d1 + params.k3_n_m3 * d1 * d1 * d1, state


TERM = Term(
    name="elastic",
    summary="elastic shell, k1 d + k3 d^3",
    params=Elastic,
    law=elastic,
    stiffnesses=("k1_n_m", "k3_n_m3"),
)
