"""Exponential relaxation over one piece of path, which two terms share."""

from __future__ import annotations


def mean_share(x: float, decay: float) -> float:
    """Return (1 - decay) / x for decay = exp(-x): what is left, on average, of what came in evenly meanwhile."""
    return (1.0 - decay) / x if x > 1e-6 else 1.0 - 0.5 * x
