"""Confidence intervals of recognition rates, all at 95 %.

One rate: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. Difference of two rates on the same trials: method 10 of
R. G. Newcombe, Statistics in Medicine 17 (1998) 2635, which combines two Wilson intervals.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from attrs import frozen

Z: Final = 1.959963984540054
"""97.5 % quantile of the standard normal distribution."""


@frozen
class RecognitionRate:
    """A number of correct trials out of `n`, with its 95 % Wilson interval."""

    correct: int
    n: int

    def __attrs_post_init__(self) -> None:
        if self.n < 1 or not 0 <= self.correct <= self.n:
            raise ValueError(f"{self.correct} correct of {self.n} is not a rate")

    @property
    def rate(self) -> float:
        """The share of correct trials."""
        return self.correct / self.n

    @property
    def interval(self) -> tuple[float, float]:
        """The Wilson interval."""
        return wilson(self.correct, self.n)

    @property
    def words(self) -> str:
        """The rate as text: percentage, counts and interval."""
        return f"{percentage(self.rate)} ({self.correct} of {self.n}; 95 %: {percentages(self.interval)})"


@frozen
class Difference:
    """A rate minus another rate on the same trials, with its 95 % interval."""

    value: float
    interval: tuple[float, float]

    @property
    def words(self) -> str:
        """The difference as text, in percentage points, with its interval."""
        low, high = self.interval
        return f"{100 * self.value:+.1f} points (95 %: {100 * low:+.1f} to {100 * high:+.1f})"


def percentage(share: float) -> str:
    """Return a share in per cent."""
    return f"{100 * share:.1f} %"


def percentages(interval: tuple[float, float]) -> str:
    """Return an interval of shares in per cent."""
    return f"{100 * interval[0]:.1f} to {100 * interval[1]:.1f} %"


def wilson(correct: float, n: int) -> tuple[float, float]:
    """Return the 95 % Wilson interval of `correct` out of `n`; `correct` may be a mean of several counts."""
    p, zz = correct / n, Z * Z
    middle = (p + zz / (2 * n)) / (1 + zz / n)
    half = Z / (1 + zz / n) * math.sqrt(p * (1 - p) / n + zz / (4 * n * n))
    # At 0 and 1 the interval ends exactly there; rounding must not exceed them.
    low = 0.0 if correct == 0 else max(middle - half, 0.0)
    high = 1.0 if correct == n else min(middle + half, 1.0)
    return low, high


def difference(first: Sequence[bool], second: Sequence[bool]) -> Difference:
    """Return the rate of `first` minus that of `second`; both state which of the same trials are correct.

    Raises ValueError if their lengths differ or are zero.
    """
    n = len(first)
    if n == 0 or len(second) != n:
        raise ValueError(f"{n} and {len(second)} trials: both must be of the same trials")
    both = sum(1 for x, y in zip(first, second, strict=True) if x and y)
    only_first = sum(1 for x, y in zip(first, second, strict=True) if x and not y)
    only_second = sum(1 for x, y in zip(first, second, strict=True) if y and not x)
    neither = n - both - only_first - only_second
    right1, right2 = both + only_first, both + only_second
    p1, p2 = right1 / n, right2 / n
    (low1, high1), (low2, high2) = wilson(right1, n), wilson(right2, n)
    phi = _correlation(both, only_first, only_second, neither)
    below, above = _added(p1 - low1, high2 - p2, phi), _added(high1 - p1, p2 - low2, phi)
    value = p1 - p2
    return Difference(value, (max(value - below, -1.0), min(value + above, 1.0)))


def _correlation(both: int, only_first: int, only_second: int, neither: int) -> float:
    """Return Newcombe's phi, with his continuity correction for a positive correlation."""
    n = both + only_first + only_second + neither
    margins = (both + only_first) * (only_second + neither) * (both + only_second) * (only_first + neither)
    if margins == 0:
        return 0.0
    product = float(both * neither - only_first * only_second)
    if product > 0.0:
        product = max(product - n / 2.0, 0.0)
    return product / math.sqrt(margins)


def _added(one: float, other: float, phi: float) -> float:
    return math.sqrt(max(one * one - 2.0 * phi * one * other + other * other, 0.0))
