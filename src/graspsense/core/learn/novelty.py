"""Novelty detection: whether a trial is unlike all training data, by one rule for every classifier.

For each class and feature, the model has the range of the training trials. A trial is unlike a class if one of its
features lies outside that range by more than `REACH` times the standard deviation of the feature within classes (pooled
over the classes). It is *unknown* if it is unlike every class, or has no feature at all. Missing features are ignored.

What was measured on held-out trials holds for those that are no farther outside than nearly all of these were.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.learn.stored_values import StoredValues
from graspsense.core.values.errors import listed
from graspsense.core.values.features import Features, FeatureTable
from graspsense.core.values.json_values import json_ready
from graspsense.core.values.reasons import FeatureValue, Reason
from graspsense.core.values.units import in_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

REACH: Final = 3.0
"""Distance from the range of a class, in standard deviations, up to which a trial is like the class."""
_ROUNDING: Final = 1e-9
"""Relative difference allowed to a feature that was constant in training."""
_FARTHEST: Final = float(np.finfo(np.float64).max)
"""A distance that overflows counts as this one: infinite is that of a trial without any feature in common."""
_ROWS_AT_ONCE: Final = 4096

Distance = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
"""Returns the distance of each value from each class, in standard deviations."""


@frozen(kw_only=True, eq=False)
class Novelty:
    """The ranges of the training trials.

    `lowest` and `highest` have shape (classes, features), NaN for a feature that a class never had; `spread`, the
    standard deviation within classes, has shape (features,), NaN if unknown.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    classes: tuple[str, ...]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    spread: NDArray[np.float64]
    featureless: bool
    """Whether a training trial had no feature at all, so that such a trial is not new."""
    complete: NDArray[np.bool_]
    """Whether each training trial had the feature, shape (features,); False where it is not known."""

    def unmeasured(self, table: FeatureTable, reach: float) -> list[str]:
        """Return for each trial of a table why what held-out trials told does not hold for it; empty if it does.

        It does not if the trial lacks a feature that each training trial had, or is outside by more than `reach`.
        """
        table = table.columns(self.names)
        lacking = np.isnan(table.values) & self.complete
        far = self.outside(table) > reach
        why = [""] * len(table)
        for i in np.flatnonzero(lacking.any(axis=1) | far).tolist():
            if lacking[i].any():
                names = listed([self.names[f] for f in np.flatnonzero(lacking[i])])
                why[i] = f"it was measured with trials that have {names}"
            else:
                strange = self.unlike(table.row(i), reach)
                why[i] = f"the trials that it was measured with were closer to those learned from: {strange}"
        return why

    def unlike(self, features: Features, reach: float = REACH) -> Reason | None:
        """Return why this trial is outside of every class by more than `reach`, or None if it is not."""
        values = np.array([features[name] for name in self.names])
        if np.isnan(values).all():
            if self.featureless:
                return None
            reasons = "; ".join(sorted(set(features.reasons.values())))
            return Reason(words=f"no feature is defined: {reasons}" if reasons else "no feature is defined")
        outside = self._outside(values)
        worst = _worst(outside)
        k = int(np.argmin(worst))
        if worst[k] <= reach:
            return None
        if math.isinf(worst[k]):
            return Reason(words="it has none of the features that the training trials had")
        f = int(np.nanargmax(outside[k]))
        unit = self.units[f]
        low, high = (in_words(float(end[k, f]), unit) for end in (self.lowest, self.highest))
        feature = FeatureValue(self.names[f], float(values[f]), unit)
        return Reason(
            words=f"{feature.words} is unlike everything trained on: "
            f"the nearest, {self.classes[k]}, has {low} to {high}",
            features=(feature,),
        )

    def outside(self, table: FeatureTable) -> NDArray[np.float64]:
        """Return how far each trial of a table is outside of the nearest class, in standard deviations."""
        values = table.columns(self.names).values
        outside = self._worst_of(values, self._outside).min(axis=1)
        outside[np.isnan(values).all(axis=1)] = 0.0 if self.featureless else np.inf
        return np.asarray(outside)

    def closeness(self, table: FeatureTable, classes: Sequence[str]) -> NDArray[np.float64]:
        """Return how close each trial is to the middle of each of these classes, shape (trials, classes).

        It is 1 / (1 + distance) of the feature that is farthest from the middle of the range, in standard deviations.
        Without a feature in common it is 0.
        """
        columns = [self.classes.index(name) for name in classes]
        away = self._worst_of(table.columns(self.names).values, self._from_middle)
        return np.asarray(1.0 / (1.0 + away[:, columns]))

    def _worst_of(self, values: NDArray[np.float64], distance: Distance) -> NDArray[np.float64]:
        """Return the largest distance of a feature of each trial, shape (trials, classes), some trials at once."""
        result = np.empty((len(values), len(self.classes)))
        for start in range(0, len(values), _ROWS_AT_ONCE):
            some = values[start : start + _ROWS_AT_ONCE]
            result[start : start + len(some)] = _worst(distance(some[:, np.newaxis, :]))
        return result

    @np.errstate(invalid="ignore", over="ignore")
    def _outside(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each value from the range of each class, in standard deviations; NaN if unknown."""
        outside = np.maximum(np.maximum(self.lowest - values, values - self.highest), 0.0)
        return self._scaled(outside, values)

    @np.errstate(invalid="ignore", over="ignore")
    def _from_middle(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the distance of each value from the middle of the range of each class, as `_outside` does."""
        return self._scaled(np.abs(values - 0.5 * (self.lowest + self.highest)), values)

    def _scaled(self, away: NDArray[np.float64], values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return distances in standard deviations; of a feature that was constant, in what rounding may change."""
        rounding = _ROUNDING * np.maximum(np.abs(values), np.finfo(np.float64).tiny / _ROUNDING)
        return np.minimum(away / np.where(self.spread > 0.0, self.spread, rounding), _FARTHEST)

    def to_json(self) -> dict[str, Any]:
        """Return the ranges as values that JSON represents exactly; an unknown one is None."""
        return {
            "reach": REACH,
            "featureless": self.featureless,
            "complete": [name for name, complete in zip(self.names, self.complete, strict=True) if complete],
            "spread": json_ready(self.spread.tolist()),
            "ranges": {
                label: json_ready([lowest, highest])
                for label, lowest, highest in zip(
                    self.classes, self.lowest.tolist(), self.highest.tolist(), strict=True
                )
            },
        }


def novelty_of(table: FeatureTable, labels: Sequence[str]) -> Novelty:
    """Return the ranges of these training trials."""
    values, given = table.values, np.array(labels)
    classes = tuple(sorted(set(labels)))
    lowest, highest = np.full((2, len(classes), len(table.names)), np.nan)
    # Powers of two, which keep every digit: the square of a value below 1e-162 would be 0.
    units = np.ldexp(1.0, np.frexp(np.nan_to_num(np.abs(values)).max(axis=0))[1] - 1)
    squares, freedom = np.zeros(len(table.names)), np.zeros(len(table.names), dtype=np.int64)
    for k, label in enumerate(classes):
        rows = values[given == label].T.copy()
        known = ~np.isnan(rows)
        trials = known.sum(axis=1)
        have = trials > 0
        lowest[k, have], highest[k, have] = np.nanmin(rows[have], axis=1), np.nanmax(rows[have], axis=1)
        means = np.where(known, rows, 0.0).sum(axis=1) / np.maximum(trials, 1)
        squares += np.where(known, ((rows.T - means) / units).T ** 2, 0.0).sum(axis=1)
        freedom += np.maximum(trials - 1, 0)
    spread = units * np.sqrt(squares / np.maximum(freedom, 1))
    for f in np.flatnonzero(freedom == 0).tolist():
        # With one trial in each class, the differences between classes are the only measure of spread.
        measured = values[~np.isnan(values[:, f]), f]
        spread[f] = float(measured.std()) if len(measured) else math.nan
    return Novelty(
        names=table.names,
        units=table.units,
        classes=classes,
        lowest=lowest,
        highest=highest,
        spread=spread,
        featureless=bool(np.isnan(values).all(axis=1).any()),
        complete=np.asarray(~np.isnan(values).any(axis=0), dtype=np.bool_),
    )


def novelty_from(names: Sequence[str], units: Sequence[str], kept: StoredValues) -> Novelty:
    """Return the ranges that `to_json` described. Raises DataDamaged."""
    if kept.number("reach") != REACH:
        raise kept.refusal("reach", f"the rule for unknown trials has another one; this version has {REACH}")
    ranges = kept.table("ranges")
    classes = tuple(ranges)
    ends = np.empty((2, len(classes), len(names)))
    for k, label in enumerate(classes):
        ends[:, k, :] = ranges.numbers(label, (2, len(names)), missing=True)
    lowest, highest = ends
    if (np.isnan(lowest) != np.isnan(highest)).any() or (lowest > highest).any():
        raise kept.refusal("ranges", "a feature has one end only, or its highest value is below the lowest")
    complete = kept.texts("complete") if "complete" in kept else ()
    spread = kept.numbers("spread", (len(names),), missing=True, least=0.0)
    if (np.isnan(spread) & ~np.isnan(lowest).all(axis=0)).any():
        raise kept.refusal("spread", "it is missing for a feature that has a range")
    return Novelty(
        names=tuple(names),
        units=tuple(units),
        classes=classes,
        lowest=lowest,
        highest=highest,
        spread=spread,
        featureless=kept.flag("featureless"),
        complete=np.array([name in complete for name in names]),
    )


def _worst(outside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the maximum along the last axis, ignoring NaN; infinite if all are NaN."""
    known = ~np.isnan(outside)
    return np.where(known.any(axis=-1), np.where(known, outside, -1.0).max(axis=-1), np.inf)
