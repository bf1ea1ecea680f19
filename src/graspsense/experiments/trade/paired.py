"""Paired tests of two classifiers on the same trials and folds."""

from __future__ import annotations

import math
from collections.abc import Sequence

from attrs import frozen


@frozen
class McNemar:
    """Numbers of trials that only the first, or only the second classifier predicts correctly."""

    only_first: int
    only_second: int

    @property
    def p(self) -> float:
        """The exact two-sided p-value under the hypothesis that both are equally good."""
        from scipy.stats import binomtest

        n = self.only_first + self.only_second
        return 1.0 if n == 0 else float(binomtest(self.only_first, n, 0.5).pvalue)


def mcnemar(first: Sequence[bool], second: Sequence[bool]) -> McNemar:
    """Return McNemar's counts; the lists state which of the same trials are predicted correctly."""
    pairs = list(zip(first, second, strict=True))
    return McNemar(sum(a > b for a, b in pairs), sum(a < b for a, b in pairs))


def corrected_t(differences: Sequence[float], tested: float, trained: float) -> float:
    """Return the two-sided p of the corrected resampled t-test on differences by fold.

    The folds of a cross validation share training trials, so the variance of their mean is that of independent ones
    plus the share that `tested` trials are of `trained` ones (Nadeau and Bengio, Machine Learning 52, 2003).
    """
    from scipy.special import stdtr

    n = len(differences)
    if n < 2:
        raise ValueError(f"{n} differences: give two or more")
    mean = math.fsum(differences) / n
    variance = math.fsum((one - mean) ** 2 for one in differences) / (n - 1)
    if variance == 0.0:
        return 1.0 if mean == 0.0 else 0.0
    t = abs(mean) / math.sqrt((1.0 / n + tested / trained) * variance)
    return float(2.0 * stdtr(n - 1, -t))
