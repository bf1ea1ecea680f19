"""The level of the intervals of an identification, and the quantiles that belong to it."""

from __future__ import annotations

from typing import Final

LEVEL: Final = 0.90


def student(degrees: int) -> float:
    """Return half the width of the interval of Student's t with so many degrees of freedom, in standard deviations."""
    from scipy.stats import t

    return float(t.ppf(0.5 + 0.5 * LEVEL, degrees))


def normal() -> float:
    """Return half the width of the interval of a normal distribution, in standard deviations."""
    from scipy.stats import norm

    return float(norm.ppf(0.5 + 0.5 * LEVEL))
