"""The results of an evaluation of predicted numbers; their JSON form is that of `graspsense evaluate --json`.

Errors have 95 % intervals that take the instances into account.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

from attrs import frozen

from graspsense.core.values.errors import counted
from graspsense.core.values.units import with_unit
from graspsense.evaluation.intervals import Difference, Interval, RecognitionRate, mean_interval


@frozen(kw_only=True)
class RegressionError:
    """The error of predicted numbers, in their unit.

    `mean_absolute` is the mean absolute error, with its 95 % `interval` (None with the reason in `no_interval`),
    `root_mean_square` that of the squared errors. `instances` is the number of objects that the interval takes into
    account, None if they are not known.
    """

    n: int
    mean_absolute: float
    root_mean_square: float
    interval: Interval | None
    no_interval: str = ""
    instances: int | None = None

    def words(self, unit: str) -> str:
        """Return the mean absolute error as text, with its interval."""
        counts = counted(self.n, "trial") + (
            "" if self.instances is None else f" of {counted(self.instances, 'instance')}"
        )
        error = with_unit(f"{self.mean_absolute:.4g}", unit)
        if self.interval is None:
            return f"{error} ({counts}; no interval: {self.no_interval})"
        low, high = self.interval
        return f"{error} (95 %: {low:.4g} to {high:.4g}; {counts})"


def error_of(errors: Sequence[float], instances: Sequence[str] | None, folds: int = 0) -> RegressionError:
    """Return the error of these predictions; `errors` are predicted minus true values, `folds` is of `rate_of`.

    The interval is as wide on the logarithm of the error as Student's: it does not reach zero, and reaches farther
    upwards, where the few large errors are that these trials may not have.
    """
    absolute = [abs(error) for error in errors]
    mean = math.fsum(absolute) / len(absolute)
    interval, reason = mean_interval(absolute, instances, folds)
    if interval is not None and mean > 0.0:
        factor = math.exp((interval[1] - mean) / mean)
        interval = (mean / factor, mean * factor)
    return RegressionError(
        n=len(absolute),
        mean_absolute=mean,
        root_mean_square=math.sqrt(math.fsum(error * error for error in errors) / len(errors)),
        interval=interval,
        no_interval=reason,
        instances=None if instances is None else len(set(instances)),
    )


def difference_of_errors(
    errors: Sequence[float], others: Sequence[float], instances: Sequence[str] | None, folds: int = 0
) -> Difference:
    """Return the mean absolute error of `errors` minus that of `others`, of the same trials, with its 95 % interval.

    `folds` is as in `rate_of`.
    """
    each = [abs(value) - abs(other) for value, other in zip(errors, others, strict=True)]
    interval, reason = mean_interval(each, instances, folds)
    return Difference(math.fsum(each) / len(each), interval, reason)


@frozen(kw_only=True)
class RegressionMeasurement:
    """An error under one protocol or control, or the reason why it could not be measured.

    `difference` is this mean absolute error minus that of the protocol named in `difference_of`, on the same trials.
    """

    what: str
    error: RegressionError | None = None
    reason: str = ""
    difference: Difference | None = None
    difference_of: str = ""


@frozen(kw_only=True)
class IntervalCoverage:
    """The share of held-out trials whose prediction interval contains the true number.

    `mean_half_width` is the mean of half the width of the intervals, in the unit of the number. Both are None if there
    are too few units to calibrate an interval; `reason` then says so.
    """

    asked: float
    unit: str
    covered: RecognitionRate | None = None
    mean_half_width: float | None = None
    reason: str = ""


@frozen(kw_only=True)
class RegressionEvaluation:
    """How well a number is predicted. Errors are in the unit of the number."""

    source: str
    estimator: str
    target_value: str
    unit: str
    features: tuple[tuple[str, str], ...]
    folds: int
    seed: int
    protocol: str
    """The protocol of `headline`."""
    headline: RegressionError
    explained: float | None
    """1 minus the squared errors over those of always predicting the mean of the training trials; None if these are 0.

    This is the coefficient of determination with held-out trials: 1 is perfect, 0 no better than the mean.
    """
    protocols: Mapping[str, RegressionMeasurement]
    controls: Mapping[str, RegressionMeasurement]
    intervals: IntervalCoverage
    predictions: tuple[tuple[float, float], ...]
    """The true and the predicted number of each trial, by the protocol of the headline."""
    warnings: tuple[str, ...]
    notes: tuple[str, ...]
