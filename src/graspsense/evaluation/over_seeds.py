"""Rates of one experiment over several seeds: their mean, its interval, and a prediction interval."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import stdev

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
