"""Rates of one experiment over several seeds: their mean, its interval, a prediction interval, and equivalence.

Two rates are equivalent within a margin if the mean of their differences, paired by seed, is above -margin and below
+margin, each at 95 % (two one-sided tests, D. J. Schuirmann, Journal of Pharmacokinetics and Biopharmaceutics 15,
1987). This is the case if the 90 % interval of Student's t lies within the margin. With several comparisons, the level
of each test is 5 % divided by their number (Bonferroni).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import stdev
from typing import Final, Literal

import numpy as np
from attrs import frozen

from graspsense.evaluation.intervals import (
    Interval,
    RecognitionRate,
    percent,
    percentages,
    t_quantile,
    wilson,
)


@frozen
class OverSeeds:
    """Rates of independent seeds, each with its own objects, grasps and folds.

    `interval` is the confidence interval of the mean, `prediction` the interval for the rate of one more seed. Both
    are at 95 %, from Student's t with one degree of freedom less than there are seeds, clipped to 0 and 1. A published
    rate is one such run, so it is compared with `prediction`. Neither interval is narrower than the Wilson interval of
    the trials (of all seeds, or of one), because a few seeds may agree by chance. With one seed, both are the interval
    of its trials: that of `single` if given (None if it has none), else Wilson's.
    """

    rates: tuple[float, ...]
    n: int
    """Trials per seed."""
    single: RecognitionRate | None = None
    """The rate of the only run, if there is one run."""

    def __attrs_post_init__(self) -> None:
        if not self.rates or self.n < 1:
            raise ValueError("give at least one rate, of at least one trial")

    @property
    def mean(self) -> float:
        """The mean over the seeds."""
        return math.fsum(self.rates) / len(self.rates)

    @property
    def interval(self) -> Interval | None:
        """The 95 % interval of the mean."""
        return self._around(math.sqrt(1 / len(self.rates)), self.n * len(self.rates))

    @property
    def prediction(self) -> Interval | None:
        """The 95 % prediction interval for the rate of one more seed."""
        return self._around(math.sqrt(1 + 1 / len(self.rates)), self.n)

    def _around(self, factor: float, n: int) -> Interval | None:
        if len(self.rates) == 1 and self.single is not None:
            return self.single.interval
        least = wilson(self.mean * n, n)
        if len(self.rates) == 1:
            return least
        half = t_quantile(len(self.rates) - 1) * stdev(self.rates) * factor
        return max(min(self.mean - half, least[0]), 0.0), min(max(self.mean + half, least[1]), 1.0)

    @property
    def words(self) -> str:
        """The mean as text, with its interval."""
        if self.interval is None:
            return (
                f"{percent(self.mean)} (no interval{f': {self.single.no_interval}' if self.single else ''})"
            )
        return f"{percent(self.mean)} (95 %: {percentages(self.interval)})"


@frozen
class MeanDifference:
    """The mean of differences paired by seed, its 95 % interval and two-sided p from Student's t.

    Both are corrected for the number of comparisons that are made with the same rate (Bonferroni), so that the interval
    excludes zero exactly if p is below 0.05.
    """

    value: float
    interval: Interval
    p: float


def mean_difference(
    minuend: Sequence[float], subtrahend: Sequence[float], n: int, comparisons: int = 1
) -> MeanDifference:
    """Return the mean of `minuend` minus `subtrahend`, paired by seed.

    Rates of `n` trials have steps of 1/n, so the standard deviation between seeds is taken as at least 1/n. Raises
    ValueError if the lengths differ or there are fewer than two seeds.
    """
    from scipy.special import stdtr

    if len(minuend) != len(subtrahend) or len(minuend) < 2:
        raise ValueError(f"{len(minuend)} and {len(subtrahend)} rates: give two or more, of the same seeds")
    each = [value - other for value, other in zip(minuend, subtrahend, strict=True)]
    mean = math.fsum(each) / len(each)
    error = max(stdev(each), 1 / n) / math.sqrt(len(each))
    half = t_quantile(len(each) - 1, comparisons) * error
    p = 2.0 * float(stdtr(len(each) - 1, -abs(mean) / error))
    return MeanDifference(mean, (max(mean - half, -1.0), min(mean + half, 1.0)), min(1.0, comparisons * p))


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
