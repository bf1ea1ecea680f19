"""Dissipation by the contents of a container."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.term import NoState, Term


class Loss(NamedTuple):
    """A damper on the compression that represents the contents. Its value is fitted (see the catalogue)."""

    damping_n_s_m: float


def loss(params: Loss, state: NoState, d0: float, d1: float, h: float, v1: float) -> tuple[float, NoState]:
    """Return the force of the damper."""
    return params.damping_n_s_m * v1, state


TERM = Term(
    name="loss",
    summary="damper on the compression; fitted where it is used",
    params=Loss,
    law=loss,
)
