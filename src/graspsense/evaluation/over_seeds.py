"""Rates of one experiment over several seeds: their mean, how sure it is, and where a further one would lie."""

from __future__ import annotations

import math
from collections.abc import Sequence

from attrs import frozen

from graspsense.evaluation.intervals import wilson


@frozen
class OverSeeds:
    """Rates of seeds that are independent of each other: each with things, grasps and folds of its own.

    `interval` is that of the mean, `further` where the rate of one further seed lies, both at 95 %, by Student's t
    with one degree of freedom less than there are seeds, kept within 0 and 1. A published rate is one such run: it is
    to be held against `further`. Neither is taken narrower than the Wilson interval of the trials, of all seeds or
    of one, so that seeds which agree by chance are not taken for certainty; with one seed it stands for both.
    """

    rates: tuple[float, ...]
    n: int
    """Trials of one seed."""

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
    def further(self) -> tuple[float, float]:
        """Where the rate of one further seed lies, at 95 %."""
        return self._around(math.sqrt(1 + 1 / len(self.rates)), self.n)

    def _around(self, factor: float, n: int) -> tuple[float, float]:
        least = wilson(self.mean * n, n)
        if len(self.rates) == 1:
            return least
        half = _t(len(self.rates) - 1) * _deviation(self.rates) * factor
        return max(min(self.mean - half, least[0]), 0.0), min(max(self.mean + half, least[1]), 1.0)

    @property
    def words(self) -> str:
        """Return it as a person reads it."""
        low, high = self.interval
        return f"{self.mean:.3f} (95 % {low:.3f} to {high:.3f})"


def mean_difference(
    first: Sequence[float], second: Sequence[float], n: int
) -> tuple[float, tuple[float, float]]:
    """Return the mean of `first` less `second`, seed by seed, and its 95 % interval by Student's t.

    Rates of `n` trials come in steps of 1/n, so the deviation between seeds is taken for at least that. Raises
    ValueError where there are not the same seeds, or fewer than two.
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
