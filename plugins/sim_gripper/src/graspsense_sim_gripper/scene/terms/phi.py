"""The phi functions of exponential integrators, for linear relaxation over a step.

q' = k v(t) - q/tau is solved exactly where v changes linearly over the step h. With x = h/tau

    q(h) = exp(-x) q(0) + k h (v_mean phi1(-x) + (v_end - v_mean) (2 phi2(-x) - phi1(-x))),

where phi1(z) = (exp(z) - 1)/z and phi2(z) = (phi1(z) - 1)/z (Hochbruck and Ostermann, Acta Numerica 19, 2010).
"""

from __future__ import annotations

import math


def phi1(x: float, decay: float) -> float:
    """Return phi1(-x) for decay = exp(-x), the weight of the mean rate."""
    # The product waits for the exponential; the quotient is computed meanwhile.
    return (1.0 - decay) * (1.0 / x) if x > 1e-6 else 1.0 - 0.5 * x


def phi_ramp(x: float, decay: float) -> float:
    """Return 2 phi2(-x) - phi1(-x) for decay = exp(-x), the weight of a rate that rises from -1 to 1 over the step."""
    if x < 1e-3:
        return x * (1.0 - 0.5 * x) / 6.0
    per_x = 1.0 / x
    return 2.0 * per_x - (2.0 * per_x + 1.0) * ((1.0 - decay) * per_x)


def phi_1_2(x: float) -> tuple[float, float]:
    """Return phi1(-x) and phi2(-x), the weights of a constant rate in the value after a step and in its integral."""
    if abs(x) < 1e-2:
        return (
            1.0 - 0.5 * x * (1.0 - x / 3.0 * (1.0 - 0.25 * x)),
            0.5 - x / 6.0 * (1.0 - 0.25 * x * (1.0 - 0.2 * x)),
        )
    phi1_x = (1.0 - math.exp(-x)) / x
    return phi1_x, (1.0 - phi1_x) / x
