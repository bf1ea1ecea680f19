"""The tests on the way to a leaf of a decision tree, as the reasons for a prediction.

A tree may test a feature several times. Only the tightest bounds matter: `p_first > 56.9 mm` and `p_first > 57 mm`
are `p_first > 57 mm`.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from attrs import frozen

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
    tested: dict[str, list[SplitTest]] = {}
    for test in tests:
        if not math.isnan(test.value):
            tested.setdefault(test.feature, []).append(test)
    return (*map(_range, tested.values()), *missing)


def leaf_reason(with_label: float, trials: float, label: str) -> Reason:
    """Return what the training trials at a leaf were."""
    return Reason(words=f"{with_label:.4g} of the {trials:.4g} training trials in this leaf were {label}")


def _range(tests: Sequence[SplitTest]) -> Reason:
    """Return the tightest bounds of a feature, as in `57 mm < p_first = 57.9 mm <= 59.9 mm`."""
    feature, unit, given = tests[0].feature, tests[0].unit, tests[0].value
    low = max((test.threshold for test in tests if test.above), default=None)
    high = min((test.threshold for test in tests if not test.above), default=None)
    value, *shown = in_words_apart([given, *(bound for bound in (low, high) if bound is not None)], unit)
    words = f"{feature} = {value}"
    if len(shown) == 2:
        words = f"{shown[0]} < {words} <= {shown[1]}"
    else:
        words = f"{words} {'<=' if low is None else '>'} {shown[0]}"
    return Reason(words=words, features=(FeatureValue(feature, given, unit),), above=low, up_to=high)
