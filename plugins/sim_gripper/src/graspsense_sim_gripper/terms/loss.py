"""What the contents of a container dissipate."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import Limit, LinearForm, NoState, Term, WorkingPoint


class Loss(NamedTuple):
    """What the contents dissipate: a damper on the compression. Fitted, not derived (see the catalogue)."""

    damping_n_s_m: float


def loss(params: Loss, state: NoState, d0: float, d1: float, h: float, v1: float) -> tuple[float, NoState]:
    """Return the damper's force."""
    return params.damping_n_s_m * v1, state


def limits(params: Loss, at: WorkingPoint) -> tuple[Limit, ...]:
    """Return the damper that it is."""
    return (Limit("damper", damper_n_s_m=params.damping_n_s_m),)


def linear(params: Loss) -> LinearForm:
    """Return the damper that it is."""
    return LinearForm(0.0, params.damping_n_s_m)


TERM = Term(
    name="loss",
    summary="damper on the compression; fitted where it is used",
    params=Loss,
    law=loss,
    limits=limits,
    linear=linear,
)
