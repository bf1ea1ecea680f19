"""Rates of one experiment over several seeds: their mean, its interval, and a prediction interval."""

from __future__ import annotations

import math
from collections.abc import Sequence

from attrs import frozen

from graspsense.evaluation.intervals import wilson


@frozen
class OverSeeds:
    """Rates of independent seeds, each with its own objects, grasps and folds.

    `interval` is the confidence interval of the mean, `prediction` the interval for the rate of one more seed. Both
    are at 95 %, from Student's t with one degree of freedom less than there are seeds, clipped to 0 and 1. A published
    rate is one such run, so it is compared with `prediction`. Neither interval is narrower than the Wilson interval of
    the trials (of all seeds, or of one), because a few seeds may agree by chance. With one seed, both are it.
    """

    rates: tuple[float, ...]
    n: int
    """Trials per seed."""

    def __attrs_post_init__(self) -> None:
        if not self.rates or self.n < 1:
            raise ValueError("give at least one rate, of at least one trial")

    @property
    def mean(self) -> float:
        """The mean over the seeds."""
        return math.fsum(self.rates) / len(self.rates)

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the mean."""
        return self._around(math.sqrt(1 / len(self.rates)), self.n * len(self.rates))

    @property
    def prediction(self) -> tuple[float, float]:
        """The 95 % prediction interval for the rate of one more seed."""
        return self._around(math.sqrt(1 + 1 / len(self.rates)), self.n)

    def _around(self, factor: float, n: int) -> tuple[float, float]:
        least = wilson(self.mean * n, n)
        if len(self.rates) == 1:
            return least
        half = _t(len(self.rates) - 1) * _deviation(self.rates) * factor
        return max(min(self.mean - half, least[0]), 0.0), min(max(self.mean + half, least[1]), 1.0)

    @property
    def words(self) -> str:
        """The mean as text, with its interval."""
        low, high = self.interval
        return f"{self.mean:.3f} (95 % {low:.3f} to {high:.3f})"


def mean_difference(
    first: Sequence[float], second: Sequence[float], n: int
) -> tuple[float, tuple[float, float]]:
    """Return the mean of `first` minus `second`, paired by seed, and its 95 % interval from Student's t.

    Rates of `n` trials have steps of 1/n, so the standard deviation between seeds is taken as at least 1/n. Raises
    ValueError if the lengths differ or there are fewer than two seeds.
    """
    if len(first) != len(second) or len(first) < 2:
        raise ValueError(f"{len(first)} and {len(second)} rates: give two or more, of the same seeds")
    each = [one - other for one, other in zip(first, second, strict=True)]
    mean = math.fsum(each) / len(each)
    half = _t(len(each) - 1) * max(_deviation(each), 1 / n) / math.sqrt(len(each))
    return mean, (mean - half, mean + half)


def _deviation(values: Sequence[float]) -> float:
    mean = math.fsum(values) / len(values)
    return math.sqrt(math.fsum((one - mean) ** 2 for one in values) / (len(values) - 1))


def _t(degrees: int) -> float:
    """Return the 97.5 % quantile of Student's distribution."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 0.975))
