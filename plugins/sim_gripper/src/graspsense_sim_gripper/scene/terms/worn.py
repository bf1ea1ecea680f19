"""A shell that wears with the work done on it."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_sim_gripper.scene.terms.elastic import shell_force, unstable
from graspsense_sim_gripper.scene.terms.term import Rate, Term, WorkingPoint


class Worn(NamedTuple):
    """An elastic shell that softens and keeps a dent as work is done on it.

    Damage D = 1 - exp(-W / wear_j) of the work W done on it while it is pressed in, `earlier_j` of which was done
    before this grasp. The damage reduces the stiffness by the fraction `softening` D and leaves a dent of `set_m` D.
    The dent D0 of the earlier work makes the object thinner (`dent`). Compression is counted from the dented surface:
    force (1 - softening D) (k1 e + k3 e^3) with e = d - set_m (D - D0). The law was fixed before any grasp of a worn
    bottle was simulated.
    """

    k1_n_m: float
    k3_n_m3: float
    wear_j: float
    softening: float
    set_m: float
    earlier_j: float = 0.0


class WornState(NamedTuple):
    """The work done on it in this grasp (J), and its force (N)."""

    work_j: float
    force_n: float


def worn(
    params: Worn, state: WornState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, WornState]:
    """Return the force of the shell with the damage at the end of the step; of second order, by Heun's method."""
    earlier_j = work = state.work_j
    force = _force(params, work, d1)
    if d1 > d0:
        for _ in range(2):
            # First with the damage before the step, then with that after it.
            work = earlier_j + max(0.5 * (state.force_n + force) * (d1 - d0), 0.0)
            force = _force(params, work, d1)
    return force, WornState(work, force)


def _force(params: Worn, work_j: float, d: float) -> float:
    strength = math.exp(-params.earlier_j / params.wear_j)
    strength_now = strength * math.exp(-work_j / params.wear_j)
    pressed = d - params.set_m * (strength - strength_now)
    left = 1.0 - min(params.softening, 1.0) * (1.0 - strength_now)
    return left * shell_force(params.k1_n_m, params.k3_n_m3, pressed)


def dent(params: Worn) -> float:
    """Return how deep (m) the earlier work has dented it."""
    return params.set_m * (1.0 - math.exp(-params.earlier_j / params.wear_j))


def rates(params: Worn, point: WorkingPoint) -> tuple[Rate, ...]:
    """Return the rate of wear: the work per second over `wear_j`."""
    force, _ = worn(params, WornState(0.0, 0.0), 0.0, point.compression_m, 1.0, 0.0)
    return (Rate("wears", max(force, 0.0) * point.speed_m_s / params.wear_j),)


def refusal(params: Worn) -> str:
    """Return why the shell has no stable law."""
    return unstable(params.k1_n_m, params.k3_n_m3)


TERM = Term(
    name="worn",
    summary="elastic shell that softens and keeps a dent with the work done on it",
    params=Worn,
    law=worn,
    at_rest=WornState(0.0, 0.0),
    rates=rates,
    dent=dent,
    positive=("k1_n_m", "wear_j"),
    signed=("k3_n_m3",),
    refusal=refusal,
    stiffnesses=("k1_n_m", "k3_n_m3"),
)
