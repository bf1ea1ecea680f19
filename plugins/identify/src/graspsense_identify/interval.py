"""The level of the intervals of an identification, half their widths, and the interval of a mean."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

LEVEL: Final = 0.90
_QUANTILE: Final = 0.5 + 0.5 * LEVEL


def student(degrees: int) -> float:
    """Return half the width of the interval of Student's t with so many degrees of freedom, in standard deviations."""
    from scipy.stats import t

    return float(t.ppf(_QUANTILE, degrees))


def normal() -> float:
    """Return half the width of the interval of a normal distribution, in standard deviations."""
    from scipy.stats import norm

    return float(norm.ppf(_QUANTILE))


def interval_of_mean(values: ArrayLike) -> tuple[float, float]:
    """Return the interval of the mean of independent values (Student's t); NaN for a single one."""
    v = np.asarray(values, dtype=np.float64)
    mean, n = float(v.mean()), len(v)
    if n < 2:
        return math.nan, math.nan
    half = student(n - 1) * float(np.std(v, ddof=1)) / math.sqrt(n)
    return mean - half, mean + half
