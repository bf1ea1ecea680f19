"""Two one-sided tests of equivalence of two rates over the same seeds.

Two rates are equivalent within a margin if the mean of their differences, paired by seed, is above -margin and below
+margin, each at 95 % (D. J. Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15, 1987). This is the case
if the 90 % interval of Student's t lies within the margin. With several comparisons, the level of each test is 5 %
divided by their number (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal

import numpy as np
from attrs import frozen

MARGIN: Final = 0.02
"""Rates that differ by less than this are equivalent: 2 percentage points."""
LEVEL: Final = 0.05
Verdict = Literal["agrees", "differs", "cannot be told"]


def verdict_on(interval: tuple[float, float] | None, margin: float = MARGIN) -> Verdict:
    """Return what the interval of a difference of two rates says of it; None: there is no interval.

    `agrees`: every value of the interval is smaller than the margin. `differs`: it does not contain zero. A difference
    that is both agrees: it is shown, and too small to matter.
    """
    if interval is not None and -margin < interval[0] and interval[1] < margin:
        return "agrees"
    return "cannot be told" if interval is None or interval[0] <= 0.0 <= interval[1] else "differs"


@frozen(kw_only=True)
class Equivalence:
    """The mean difference of two rates, the interval of the two one-sided tests, and their power."""

    difference: float
    interval: tuple[float, float]
    margin: float
    power: float
    """The probability that two equal rates are shown to be equivalent with as many seeds."""

    @property
    def is_equivalent(self) -> bool:
        """Whether both one-sided tests reject a difference of the margin or more."""
        return -self.margin < self.interval[0] and self.interval[1] < self.margin


def equivalence(
    rates: Sequence[float],
    reference: Sequence[float],
    trials: int,
    *,
    margin: float = MARGIN,
    comparisons: int = 1,
) -> Equivalence:
    """Return the test of `rates` minus `reference`, paired by seed; a rate is of `trials` grasps.

    The standard deviation between seeds is taken as at least 1/trials, the step of a rate. Raises ValueError if the
    lengths differ or there are fewer than two seeds.
    """
    from scipy.special import stdtr, stdtrit

    if len(rates) != len(reference) or len(rates) < 2:
        raise ValueError(f"{len(rates)} and {len(reference)} rates: give two or more, of the same seeds")
    each = np.asarray(rates, float) - np.asarray(reference, float)
    n = len(each)
    error = max(float(np.std(each, ddof=1)), 1.0 / trials) / math.sqrt(n)
    mean, quantile = float(np.mean(each)), float(stdtrit(n - 1, 1.0 - LEVEL / comparisons))
    half = quantile * error
    # With equal rates the mean difference has to be within margin - half of 0.
    reach = (margin - half) / error
    power = 2.0 * float(stdtr(n - 1, reach)) - 1.0 if reach > 0.0 else 0.0
    interval = (max(mean - half, -1.0), min(mean + half, 1.0))
    return Equivalence(difference=mean, interval=interval, margin=margin, power=power)
