"""The tests on the way to a leaf of a decision tree, as the reasons for a prediction.

A tree may test a feature several times. Only the tightest bounds matter: `p_first > 56.9 mm` and `p_first > 57 mm`
are `p_first > 57 mm`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from attrs import evolve, frozen

from graspsense.core.values.reasons import FeatureValue, Reason, missing_feature
from graspsense.core.values.units import in_words, in_words_apart


@frozen(kw_only=True)
class SplitTest:
    """A test of a trial at a node of a tree: whether a feature is above a threshold.

    `value` is that of the trial, NaN if it is missing; `above` says which branch is followed. Where the value is
    missing, `share` is the part of the training trials that took this branch.
    """

    feature: str
    unit: str
    value: float
    threshold: float
    above: bool
    share: float = 1.0


@frozen(kw_only=True)
class FeatureRange:
    """The range of a feature on a path: `low < value <= high`. A missing bound is infinite."""

    feature: str
    unit: str
    value: float
    low: float = -math.inf
    high: float = math.inf

    def contains(self, value: float) -> bool:
        """Return whether a trial with this value takes the same branches."""
        return self.low < value <= self.high

    @property
    def words(self) -> str:
        """The range as text, such as `57 mm < p_first = 57.9 mm <= 59.9 mm`."""
        bounds = [bound for bound in (self.low, self.high) if math.isfinite(bound)]
        value, *shown = in_words_apart([self.value, *bounds], self.unit)
        text = f"{self.feature} = {value}"
        if len(shown) == 2:
            return f"{shown[0]} < {text} <= {shown[1]}"
        return f"{text} {'>' if math.isfinite(self.low) else '<='} {shown[0]}"


def feature_ranges(tests: Sequence[SplitTest]) -> tuple[FeatureRange, ...]:
    """Return one range for each tested feature, in the order of the first tests; missing values have none."""
    ranges: dict[str, FeatureRange] = {}
    for test in tests:
        if math.isnan(test.value):
            continue
        known = ranges.get(test.feature) or FeatureRange(
            feature=test.feature, unit=test.unit, value=test.value
        )
        ranges[test.feature] = (
            evolve(known, low=max(known.low, test.threshold))
            if test.above
            else evolve(known, high=min(known.high, test.threshold))
        )
    return tuple(ranges.values())


def path_reasons(tests: Sequence[SplitTest]) -> tuple[Reason, ...]:
    """Return the reasons of a decision tree: the tightest bounds of each feature, and what was missing."""
    missing = [
        missing_feature(
            test.feature,
            test.unit,
            f": taken as {'>' if test.above else '<='} {in_words(test.threshold, test.unit)}, "
            f"like {100 * test.share:.0f} % of the training trials that came here",
        )
        for test in tests
        if math.isnan(test.value)
    ]
    return (*(_of_range(feature_range) for feature_range in feature_ranges(tests)), *missing)


def leaf_reason(with_label: float, trials: float, label: str) -> Reason:
    """Return what the training trials at a leaf were."""
    return Reason(words=f"{with_label:.4g} of the {trials:.4g} training trials in this leaf were {label}")


def _of_range(feature_range: FeatureRange) -> Reason:
    return Reason(
        words=feature_range.words,
        features=(FeatureValue(feature_range.feature, feature_range.value, feature_range.unit),),
        above=feature_range.low if math.isfinite(feature_range.low) else None,
        up_to=feature_range.high if math.isfinite(feature_range.high) else None,
    )
