"""The level of the intervals of an identification, half their widths, and values with their intervals."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from graspsense.simulator_api import IdentifiedParameter

LEVEL: Final = 0.90
NORMAL: Final = 1.6448536269514722
"""Half the width of the interval of a normal distribution, in standard deviations."""
NO_INTERVAL: Final = (math.nan, math.nan)

UNITS: Final = {
    "n_m": "N/m",
    "n_m3": "N/m3",
    "n_m15": "N/m1.5",
    "n": "N",
    "m": "m",
    "s": "s",
    "n_s_m": "N s/m",
}
"""The units by the ends of names."""


def student(degrees: int) -> float:
    """Return half the width of the interval of Student's t with so many degrees of freedom, in standard deviations."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.5 + 0.5 * LEVEL))


def interval_of_mean(values: ArrayLike) -> tuple[float, float]:
    """Return the interval of the mean of independent values (Student's t); NaN for a single one."""
    v = np.asarray(values, dtype=np.float64)
    mean, n = float(v.mean()), len(v)
    if n < 2:
        return NO_INTERVAL
    half = student(n - 1) * float(np.std(v, ddof=1)) / math.sqrt(n)
    return mean - half, mean + half


def identified(name: str, value: float, interval: tuple[float, float], basis: str) -> IdentifiedParameter:
    """Return a value with its interval, and with the unit that its name ends with."""
    ends = sorted((end for end in UNITS if name.endswith(f"_{end}")), key=len)
    unit = UNITS[ends[-1]] if ends else ""
    low, high = sorted(interval)
    return IdentifiedParameter(name=name, unit=unit, value=value, low=low, high=high, basis=basis)


def identified_mean(name: str, values: ArrayLike, what: str = "squeezes") -> IdentifiedParameter:
    """Return the mean of a quantity of each squeeze, or of each object; a single one has no interval."""
    v = np.asarray(values, dtype=np.float64)
    basis = f"between {len(v)} {what}" if len(v) > 1 else "one squeeze: no interval"
    return identified(name, float(v.mean()), interval_of_mean(v), basis)
