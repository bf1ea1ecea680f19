"""A spring and a damper that replace the low-order limits of several terms of an object."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import NoState


class LumpedSpringDamper(NamedTuple):
    """A spring and a damper on the compression."""

    spring_n_m: float
    damper_n_s_m: float


def lumped(
    params: LumpedSpringDamper, state: NoState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, NoState]:
    """Return the force of the spring and the damper."""
    return params.spring_n_m * d1 + params.damper_n_s_m * v1, state
