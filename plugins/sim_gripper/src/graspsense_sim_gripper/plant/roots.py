"""The next argument in the search for the root of an increasing function."""

from __future__ import annotations

import math
from typing import Final

MAX_ITERATIONS: Final = 100
"""Maximum number of evaluations of a search."""


def bracketed_secant(
    x: float, value: float, last_x: float, slope: float, lower: float, upper: float
) -> float:
    """Return the next argument: that of the secant, or that of bisection if the secant leaves the bracket.

    `lower` and `upper` are the nearest arguments known to lie below and above the root, or infinite. While one of them
    is infinite, a secant that leaves the bracket is replaced by a step of twice the last length.
    """
    secant = x - value / slope
    if lower < secant < upper:
        return secant
    if lower > -math.inf and upper < math.inf:
        return 0.5 * (lower + upper)
    length = max(2.0 * abs(x - last_x), abs(value / slope))
    return x - length if value > 0.0 else x + length
