"""Exponential relaxation over one piece of path, which terms share."""

from __future__ import annotations


def mean_share(x: float, decay: float) -> float:
    """Return (1 - decay) / x for decay = exp(-x): what is left, on average, of what came in evenly meanwhile."""
    # What waits for the exponential is a product: it comes sooner than a quotient.
    return (1.0 - decay) * (1.0 / x) if x > 1e-6 else 1.0 - 0.5 * x


def late_share(x: float, decay: float) -> float:
    """Return what the same leaves of a rate whose mean is zero, from -1 at the start evenly to 1 at the end.

    So q' = k v - q / tau comes to q0 decay + k h (v_mean mean_share + (v_end - v_mean) late_share) for a rate v that
    changes evenly over h, x being h / tau.
    """
    if x < 1e-3:
        return x * (1.0 - 0.5 * x) / 6.0
    over = 1.0 / x
    return 2.0 * over - (2.0 * over + 1.0) * ((1.0 - decay) * over)
