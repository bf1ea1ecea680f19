"""The two compliant pads in series: their spring, which may harden, and how their damper and Maxwell branch act."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.plant.state import ContactState
from graspsense_sim_gripper.scene.terms.phi import phi1, phi_ramp

MAX_ITERATIONS: Final = 100
"""Maximum number of evaluations of a search."""
ARGUMENT_RTOL: Final = 4e-16
"""Relative width of a bracket below which it contains no further floating-point number."""


class PadCompliance(NamedTuple):
    """The two fingertip pads in series: a spring, with a damper and a Maxwell branch in parallel to it."""

    stiffness_n_m: float = math.inf
    """inf: rigid pads."""
    damping_n_s_m: float = 0.0
    branch_n_m: float = 0.0
    """Stiffness of the Maxwell branch, by which the pads creep."""
    branch_tau_s: float = 1.0
    """Relaxation time of the Maxwell branch."""
    hardening_m: float = math.inf
    """Compression at which the force of the spring is twice that of a linear one; inf: it is linear."""
    exponent: float = 2.0
    """Of the hardening, which is k u (u / hardening_m)^exponent at a compression u."""


class Creep(NamedTuple):
    """How the pads' damper and Maxwell branch act over a step."""

    decay: float
    """Share of the branch's force that is left at the end."""
    mean_n_m: float
    """Stiffness of the branch against the mean rate of the pads' compression."""
    ramp_n_m: float
    """Stiffness of the branch against the change of that rate from its mean to the end."""
    damper_n_s_m: float
    """Damping coefficient of the rate at the end."""
    free_pad_m: float
    """Compression of the pads at the end if nothing pressed them."""


NO_CREEP: Final = Creep(decay=1.0, mean_n_m=0.0, ramp_n_m=0.0, damper_n_s_m=0.0, free_pad_m=0.0)


def pad_excess(pads: PadCompliance, pad_m: float) -> tuple[float, float]:
    """Return the force (N) of the pads beyond that of their linear spring at this compression, and its slope (N/m)."""
    if pads.hardening_m == math.inf or pad_m <= 0.0:
        return 0.0, 0.0
    stiffness = pads.stiffness_n_m * (pad_m / pads.hardening_m) ** pads.exponent
    return stiffness * pad_m, stiffness * (1.0 + pads.exponent)


def pad_compression(pads: PadCompliance, force_n: float) -> float:
    """Return the compression (m) of the pads at rest under this force."""
    pad = force_n / pads.stiffness_n_m
    if pads.hardening_m < math.inf and pad > 0.0:
        for _ in range(MAX_ITERATIONS):
            excess, slope = pad_excess(pads, pad)
            step = (pads.stiffness_n_m * pad + excess - force_n) / (pads.stiffness_n_m + slope)
            pad -= step
            if abs(step) <= ARGUMENT_RTOL * pad:
                break
    return pad


def creep_over(pads: PadCompliance, now: ContactState, h: float) -> Creep:
    """Return how the pads' damper and branch act over a step of `h`."""
    x = h / pads.branch_tau_s
    decay = math.exp(-x)
    ramp = pads.branch_n_m * phi_ramp(x, decay)
    mean = pads.branch_n_m * phi1(x, decay) - ramp
    damper = pads.damping_n_s_m + ramp * h
    # Backward Euler, which is enough for pads that touch nothing.
    free = ((mean + damper / h) * now.pad_m - now.branch_n * decay) / (pads.stiffness_n_m + mean + damper / h)
    return Creep(decay=decay, mean_n_m=mean, ramp_n_m=ramp, damper_n_s_m=damper, free_pad_m=free)
