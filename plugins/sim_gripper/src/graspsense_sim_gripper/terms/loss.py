"""What the contents of a container dissipate."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_sim_gripper.terms.term import NoState, Term


class Loss(NamedTuple):
    """What the contents dissipate: a damper on the compression. Fitted, not derived (see the catalogue)."""

    damping_n_s_m: float


def loss(params: Loss, state: NoState, d0: float, d1: float, h: float) -> tuple[float, NoState]:
    """Return the damper's mean force over the piece."""
    if h <= 0.0:
        return 0.0, state
    return params.damping_n_s_m * (d1 - d0) / h, state


TERM = Term(name="loss", summary="damper on the compression; fitted where it is used", params=Loss, law=loss)
