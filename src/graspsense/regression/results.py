"""The results of an evaluation of predicted numbers; their JSON form is that of `graspsense evaluate --json`."""

from __future__ import annotations

from collections.abc import Mapping

from attrs import frozen

from graspsense.evaluation.intervals import Difference, RecognitionRate
from graspsense.regression.error import RegressionError


@frozen(kw_only=True)
class RegressionMeasurement:
    """An error under one protocol or control, or the reason why it could not be measured.

    `difference` is this mean absolute error minus that of the protocol named in `difference_of`, on the same trials.
    `permutation_p` is the p-value of the headline among shuffled numbers, None for all other controls.
    """

    what: str
    error: RegressionError | None = None
    reason: str = ""
    difference: Difference | None = None
    difference_of: str = ""
    permutation_p: float | None = None


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
