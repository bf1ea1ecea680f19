"""Confidence intervals of recognition rates, all at 95 %.

Independent trials: the interval of E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209, and for the difference of two rates
on the same trials method 10 of R. G. Newcombe, Statistics in Medicine 17 (1998) 2635, which combines two of them.

Trials of the same object (*instance*) are not independent. A rate on several instances has Wilson's interval with the
effective number of trials, n divided by the design effect, and the quantile of Student's t with one degree of freedom
less than there are instances (C. Franco, R. J. A. Little, T. A. Louis and E. V. Slud, J. Surv. Stat. Methodol. 7 (2019)
334). The design effect is the variance of the rate between instances over that of independent trials, at least 1. Of
the intervals that `benchmarks/interval_coverage.py` compares, it alone covers about 95 % from six instances on.

Folds of a cross-validation share most of their training trials, so that their rates are too high or too low together.
The variance of such a rate is multiplied by 1 + k / (k - 1) for k folds (C. Nadeau and Y. Bengio, Mach. Learn. 52
(2003) 239).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from attrs import field, frozen

from graspsense.core.values.errors import counted

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled

Z: Final = 1.959963984540054
"""97.5 % quantile of the standard normal distribution."""
ALPHA: Final = 0.05
"""Probability of an error of an interval."""
MIN_INSTANCES: Final = 6
"""With fewer instances there is no interval: the variance between instances is not known well enough."""

Interval = tuple[float, float]


def percent(share: float) -> str:
    """Return a share in per cent."""
    return f"{100 * share:.1f} %"


def span(interval: Sequence[float] | None) -> str:
    """Return an interval of shares in per cent, without the sign; for a column, or beside a rate that has it."""
    if interval is None:
        return "no interval"
    return f"{100 * interval[0]:.1f} to {100 * interval[1]:.1f}"


def percentages(interval: Interval | None) -> str:
    """Return an interval of shares in per cent, with the sign."""
    return span(interval) if interval is None else f"{span(interval)} %"


@frozen
class RecognitionRate:
    """A number of correct trials out of `n`, with its 95 % interval.

    `interval` is that of `n` independent trials unless another one is given. If it is None, `no_interval` has the
    reason. `instances` is the number of objects that the interval takes into account, None if they are not known.
    """

    correct: int
    n: int
    interval: Interval | None = field()
    no_interval: str = ""
    instances: int | None = None

    @interval.default
    def _of_independent_trials(self) -> Interval | None:
        return None if self.n < 1 or not 0 <= self.correct <= self.n else wilson(self.correct, self.n)

    def __attrs_post_init__(self) -> None:
        if self.n < 1 or not 0 <= self.correct <= self.n:
            raise ValueError(f"{self.correct} correct of {self.n} is not a rate")

    @property
    def rate(self) -> float:
        """The share of correct trials."""
        return self.correct / self.n

    @property
    def words(self) -> str:
        """The rate as text: percentage, counts and interval."""
        counts = f"{percent(self.rate)} ({self.correct} of {self.n}; "
        if self.interval is None:
            return f"{counts}no interval: {self.no_interval})"
        instances = "" if self.instances is None else f" over {counted(self.instances, 'instance')}"
        return f"{counts}95 %: {percentages(self.interval)}{instances})"


@frozen
class Difference:
    """A rate minus another rate on the same trials, with its 95 % interval, or the reason why it has none."""

    value: float
    interval: Interval | None
    no_interval: str = ""

    @property
    def words(self) -> str:
        """The difference as text, in percentage points, with its interval."""
        if self.interval is None:
            return f"{100 * self.value:+.1f} points (no interval: {self.no_interval})"
        low, high = self.interval
        return f"{100 * self.value:+.1f} points (95 %: {100 * low:+.1f} to {100 * high:+.1f})"

    @property
    def points(self) -> str:
        """The difference for a table whose heading says percentage points."""
        if self.interval is None:
            return f"{100 * self.value:+.1f}"
        low, high = self.interval
        return f"{100 * self.value:+.1f} ({100 * low:+.1f} to {100 * high:+.1f})"

    @property
    def is_positive(self) -> bool:
        """Whether the difference is above zero at 95 %; False without an interval."""
        return self.interval is not None and self.interval[0] > 0.0

    @property
    def excludes_zero(self) -> bool:
        """Whether a difference is shown at 95 %; False without an interval."""
        return self.interval is not None and not self.interval[0] <= 0.0 <= self.interval[1]


def rate_of(
    right: Sequence[bool],
    instances: Sequence[str] | None = None,
    no_interval: str = "",
    comparisons: float = 1.0,
    *,
    folds: int = 0,
) -> RecognitionRate:
    """Return the rate of trials; `right` states which are correct, `instances` the object of each trial.

    `no_interval` is a reason to give no interval. The interval is corrected for a number of rates that shall hold
    together (Bonferroni), and for the training trials that the folds of a cross-validation share; `folds` is their
    number, 0 for what no fold was trained for.
    """
    correct, n = sum(right), len(right)
    if no_interval:
        return RecognitionRate(correct, n, None, no_interval)
    if instances is None:
        effect = effect_of(folds)
        return RecognitionRate(correct, n, wilson(correct / effect, n / effect, _z(comparisons)))
    count = len(set(instances))
    if count < MIN_INSTANCES:
        return RecognitionRate(correct, n, None, too_few(count), count)
    return RecognitionRate(correct, n, clustered(right, instances, comparisons, folds), instances=count)


def rate_among(
    trials: Labelled, right: Sequence[bool], rows: Sequence[int] | None = None, folds: int = 0
) -> RecognitionRate:
    """Return the rate of some of these trials (default: all), with the interval that instances and folds allow."""
    chosen = range(len(right)) if rows is None else rows
    instances = None if trials.instances is None else [trials.instances[i] for i in chosen]
    return rate_of([right[i] for i in chosen], instances, trials.no_interval, folds=folds)


def too_few(instances: int) -> str:
    """Return the reason why a rate on this number of instances has no interval."""
    return f"{counted(instances, 'instance')}, at least {MIN_INSTANCES} are needed"


def effect_of(folds: int) -> float:
    """Return by how much the variance of a rate grows, because so many folds share their training trials; 0 is none."""
    return 1.0 + folds / (folds - 1) if folds > 1 else 1.0


def clustered(
    right: Sequence[bool], instances: Sequence[str], comparisons: float = 1.0, folds: int = 0
) -> Interval:
    """Return the 95 % interval of a rate on several instances, as if these were drawn at random, as `rate_of` does."""
    n, correct = len(right), sum(right)
    variance, count = _variance_of_mean([float(is_right) for is_right in right], instances)
    p = correct / n
    # Where every trial is right (or wrong), the design effect is unknown; trials of an instance then count as one.
    effect = n / count if p in (0.0, 1.0) else max(variance / (p * (1.0 - p) / n), 1.0)
    effect *= effect_of(folds)
    return wilson(correct / effect, n / effect, t_quantile(count - 1, comparisons))


def wilson(correct: float, n: float, quantile: float = Z) -> Interval:
    """Return the 95 % Wilson interval of `correct` out of `n`; both may be means or effective numbers."""
    p, zz = correct / n, quantile * quantile
    middle = (p + zz / (2 * n)) / (1 + zz / n)
    half = quantile / (1 + zz / n) * math.sqrt(p * (1 - p) / n + zz / (4 * n * n))
    # At 0 and 1 the interval ends exactly there; rounding must not exceed them.
    low = 0.0 if correct == 0 else max(middle - half, 0.0)
    high = 1.0 if correct == n else min(middle + half, 1.0)
    return low, high


def difference(
    minuend: Sequence[bool],
    subtrahend: Sequence[bool],
    instances: Sequence[str] | None = None,
    comparisons: float = 1.0,
    *,
    folds: int = 0,
) -> Difference:
    """Return the rate of `minuend` minus that of `subtrahend`; both state which of the same trials are correct.

    With `instances`, the object of each trial, the interval is Student's t of the differences by instance, and never
    narrower than that of independent trials. It is corrected for a number of comparisons (Bonferroni), and for `folds`
    as in `rate_of`. With several comparisons it holds zero unless the sign test of the trials that differ excludes it:
    so far out, Newcombe's interval of a few trials is too narrow. Raises ValueError if the lengths differ or are zero.
    """
    n = len(minuend)
    if n == 0 or len(subtrahend) != n:
        raise ValueError(f"{n} and {len(subtrahend)} trials: both must be of the same trials")
    value = (sum(minuend) - sum(subtrahend)) / n
    effect = effect_of(folds)
    independent = _newcombe(minuend, subtrahend, effect, _z(comparisons))
    if comparisons > 1.0 and _sign_test(minuend, subtrahend, effect) * comparisons > ALPHA:
        independent = (min(independent[0], 0.0), max(independent[1], 0.0))
    if instances is None:
        return Difference(value, independent)
    count = len(set(instances))
    if count < MIN_INSTANCES:
        return Difference(value, None, too_few(count))
    each = [float(x) - float(y) for x, y in zip(minuend, subtrahend, strict=True)]
    half = t_quantile(count - 1, comparisons) * math.sqrt(effect * _variance_of_mean(each, instances)[0])
    low, high = min(value - half, independent[0]), max(value + half, independent[1])
    return Difference(value, (max(low, -1.0), min(high, 1.0)))


def _sign_test(minuend: Sequence[bool], subtrahend: Sequence[bool], effect: float) -> float:
    """Return the probability that so many of the trials that differ, or more, favour one side (Q. McNemar, 1947).

    The trials count as if they were fewer by the design effect.
    """
    from scipy.special import betainc

    better = sum(x and not y for x, y in zip(minuend, subtrahend, strict=True)) / effect
    worse = sum(y and not x for x, y in zip(minuend, subtrahend, strict=True)) / effect
    # The binomial distribution, for numbers that are not whole.
    return min(1.0, 2.0 * float(betainc(max(better, worse), min(better, worse) + 1.0, 0.5)))


def unpaired_difference(
    minuend: float, subtrahend: float, intervals: tuple[Interval, Interval], comparisons: float = 1.0
) -> Difference:
    """Return the difference of two rates whose trials are not paired, from the 95 % intervals of both.

    The method is that of squares (R. G. Newcombe, Statistics in Medicine 17 (1998) 873, method 10), widened for a
    number of comparisons (Bonferroni).
    """
    high, low = intervals
    wider = _z(comparisons) / Z
    below = wider * math.hypot(minuend - high[0], low[1] - subtrahend)
    above = wider * math.hypot(high[1] - minuend, subtrahend - low[0])
    value = minuend - subtrahend
    return Difference(value, (max(value - below, -1.0), min(value + above, 1.0)))


def mean_interval(
    values: Sequence[float], instances: Sequence[str] | None = None, folds: int = 0
) -> tuple[Interval | None, str]:
    """Return the 95 % interval of a mean by Student's t, or None with the reason.

    With `instances`, the object of each trial, these are as if drawn at random; else the trials are. `folds` is as in
    `rate_of`.
    """
    units = [str(i) for i in range(len(values))] if instances is None else instances
    count = len(set(units))
    if count < MIN_INSTANCES:
        if instances is not None:
            return None, too_few(count)
        return None, f"{counted(count, 'trial')}, at least {MIN_INSTANCES} are needed"
    mean = math.fsum(values) / len(values)
    half = t_quantile(count - 1) * math.sqrt(effect_of(folds) * _variance_of_mean(values, units)[0])
    return (mean - half, mean + half), ""


def _variance_of_mean(values: Sequence[float], instances: Sequence[str]) -> tuple[float, int]:
    """Return the variance of a mean over instances drawn at random (linearised ratio), and their number."""
    n = len(values)
    mean = math.fsum(values) / n
    by_instance: dict[str, float] = {}
    for value, instance in zip(values, instances, strict=True):
        by_instance[instance] = by_instance.get(instance, 0.0) + value - mean
    count = len(by_instance)
    return count / (count - 1) * math.fsum(
        deviation * deviation for deviation in by_instance.values()
    ) / n**2, count


def t_quantile(degrees: int, comparisons: float = 1.0) -> float:
    """Return the 97.5 % quantile of Student's distribution, for one of several comparisons."""
    from scipy.special import stdtrit

    return float(stdtrit(degrees, 1.0 - ALPHA / 2.0 / comparisons))


def _z(comparisons: float) -> float:
    """Return the 97.5 % quantile of the standard normal distribution, for one of several comparisons."""
    if comparisons == 1:
        return Z
    from scipy.special import ndtri

    return float(ndtri(1.0 - ALPHA / 2.0 / comparisons))


def _newcombe(
    minuend: Sequence[bool], subtrahend: Sequence[bool], effect: float, quantile: float
) -> Interval:
    """Return the interval of a difference on independent trials, as if these were fewer by the design effect."""
    n, pairs = len(minuend), Counter(zip(minuend, subtrahend, strict=True))
    both, only_first, only_second = pairs[True, True], pairs[True, False], pairs[False, True]
    neither = n - both - only_first - only_second
    right1, right2 = both + only_first, both + only_second
    p1, p2 = right1 / n, right2 / n
    (low1, high1), (low2, high2) = (
        wilson(right / effect, n / effect, quantile) for right in (right1, right2)
    )
    phi = _correlation(both, only_first, only_second, neither)
    below, above = _added(p1 - low1, high2 - p2, phi), _added(high1 - p1, p2 - low2, phi)
    value = p1 - p2
    return max(value - below, -1.0), min(value + above, 1.0)


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


def _added(x: float, y: float, phi: float) -> float:
    return math.sqrt(max(x * x - 2.0 * phi * x * y + y * y, 0.0))
