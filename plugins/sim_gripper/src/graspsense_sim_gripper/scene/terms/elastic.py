"""An elastic shell, which may stiffen or soften as it is compressed."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.scene.terms.term import NoState, Term

LEAST_SLOPE: Final = 0.05
"""A shell softens until its slope is this share of k1, and keeps that slope from there on."""
LEAST_SOFT_N: Final = 0.1
"""The smallest force at which a shell may have softened that far: below it no finger feels the shell at all."""


class Elastic(NamedTuple):
    """An elastic shell: force k1 d + k3 d^3.

    With k3 < 0 it softens until its slope is 5 % of k1, and goes on with that slope, so its force never falls. A k3
    that softens the shell completely before it bears 0.1 N is refused.
    """

    k1_n_m: float
    k3_n_m3: float = 0.0


def shell_force(k1_n_m: float, k3_n_m3: float, d: float) -> float:
    """Return the force (N) of a shell at a compression: k1 d + k3 d^3, odd in d.

    With k3 < 0 the slope k1 + 3 k3 d^2 falls. From the compression on where it is `LEAST_SLOPE` of k1 the force goes on
    along the tangent, so that it rises at every compression and the balance with the pads stays stable.
    """
    if k3_n_m3 < 0.0:
        end = softened_m(k1_n_m, k3_n_m3)
        if abs(d) > end:
            at_end = k1_n_m * end + k3_n_m3 * end * end * end
            return math.copysign(at_end + LEAST_SLOPE * k1_n_m * (abs(d) - end), d)
    return k1_n_m * d + k3_n_m3 * d * d * d


def softened_m(k1_n_m: float, k3_n_m3: float) -> float:
    """Return the compression (m) at which the slope of a shell with k3 < 0 is `LEAST_SLOPE` of k1."""
    return math.sqrt((1.0 - LEAST_SLOPE) * k1_n_m / (-3.0 * k3_n_m3))


def unstable(k1_n_m: float, k3_n_m3: float) -> str:
    """Return why a shell with these parameters has no stable law, with the values that are allowed; "" if it has."""
    if k3_n_m3 >= 0.0:
        return ""
    end = softened_m(k1_n_m, k3_n_m3)
    share = 1.0 - (1.0 - LEAST_SLOPE) / 3.0
    if share * k1_n_m * end >= LEAST_SOFT_N:
        return ""
    if k1_n_m <= 0.0:
        return (
            "k3_n_m3 is negative and k1_n_m is 0, so that the shell would pull: give a k1_n_m greater than 0"
        )
    least = (
        -(1.0 - LEAST_SLOPE) * share * share * k1_n_m * k1_n_m * k1_n_m / (3.0 * LEAST_SOFT_N * LEAST_SOFT_N)
    )
    return (
        f"k3_n_m3 = {k3_n_m3:g} softens the shell completely at {end * 1e3:.2g} mm, before it bears "
        f"{LEAST_SOFT_N:g} N: with this k1_n_m it has to be at least {least:.3g}"
    )


def elastic(
    params: Elastic, state: NoState, d0: float, d1: float, h: float, v1: float
) -> tuple[float, NoState]:
    """Return the force of the shell."""
    return shell_force(params.k1_n_m, params.k3_n_m3, d1), state


def refusal(params: Elastic) -> str:
    """Return why the shell has no stable law."""
    return unstable(params.k1_n_m, params.k3_n_m3)


TERM = Term(
    name="elastic",
    summary="elastic shell, k1 d + k3 d^3; softens with k3 < 0",
    params=Elastic,
    law=elastic,
    signed=("k3_n_m3",),
    refusal=refusal,
    stiffnesses=("k1_n_m", "k3_n_m3"),
)
