"""When a trial is unlike anything a model was trained on: one rule for every classifier.

For each class and feature the model keeps the range of its training trials. A trial is unlike a class where one
of its features lies further outside that range than `REACH` times the feature's standard deviation within
classes (pooled over the classes). It is *unknown* where it is unlike every class, or has no feature at all.
A missing feature is not judged.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.features import Features, FeatureTable, in_words

if TYPE_CHECKING:
    from numpy.typing import NDArray

REACH: Final = 3.0
"""Standard deviations outside of a class's own range that are still like it."""
_ROUNDING: Final = 1e-9
"""Share of a value by which a feature that was constant in training may differ from it."""
_ROWS_AT_ONCE: Final = 4096


@frozen(kw_only=True, eq=False)
class Novelty:
    """What the training trials spanned.

    `lowest` and `highest` have shape (classes, features), NaN where a class never had the feature; `spread` has
    shape (features,): the standard deviation within classes, NaN where it is not known.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    classes: tuple[str, ...]
    lowest: NDArray[np.float64]
    highest: NDArray[np.float64]
    spread: NDArray[np.float64]
    featureless: bool
    """Whether a training trial had no feature at all, so that such a trial is nothing new."""

    def unlike(self, features: Features) -> str | None:
        """Return why this trial is unlike every class, or None where it is like one."""
        values = np.array([features[name] for name in self.names])
        if np.isnan(values).all():
            if self.featureless:
                return None
            reasons = "; ".join(sorted(set(features.reasons.values())))
            return f"no feature is defined: {reasons}" if reasons else "no feature is defined"
        outside = self._outside(values)
        worst = _worst(outside)
        k = int(np.argmin(worst))
        if worst[k] <= REACH:
            return None
        if math.isinf(worst[k]):
            return "it has none of the features that the training trials had"
        f = int(np.nanargmax(outside[k]))
        unit = self.units[f]
        low, high = (in_words(float(end[k, f]), unit) for end in (self.lowest, self.highest))
        return (
            f"{self.names[f]} = {in_words(float(values[f]), unit)} is unlike everything trained on: "
            f"the nearest, {self.classes[k]}, has {low} to {high}"
        )

    def unlike_rows(self, table: FeatureTable) -> NDArray[np.bool_]:
        """Return for each trial of a table whether it is unlike every class."""
        values = table.columns(self.names).values
        unlike = np.empty(len(values), dtype=np.bool_)
        for start in range(0, len(values), _ROWS_AT_ONCE):
            some = values[start : start + _ROWS_AT_ONCE]
            outside = _worst(self._outside(some[:, np.newaxis, :]))
            unlike[start : start + len(some)] = outside.min(axis=1) > REACH
        unlike[np.isnan(values).all(axis=1)] = not self.featureless
        return unlike

    def _outside(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return in spreads how far outside each class's range each value lies; NaN where that is not known."""
        rounding = _ROUNDING * np.maximum(np.abs(values), np.finfo(np.float64).tiny / _ROUNDING)
        scale = np.where(self.spread > 0.0, self.spread, rounding)
        with np.errstate(invalid="ignore"):
            outside: NDArray[np.float64] = np.maximum(
                np.maximum(self.lowest - values, values - self.highest), 0.0
            )
            return outside / scale

    def to_json(self) -> dict[str, Any]:
        """Return the ranges as values that JSON holds exactly; None stands for an unknown one."""
        return {
            "reach": REACH,
            "featureless": self.featureless,
            "spread": _plain(self.spread),
            "ranges": {
                label: [_plain(self.lowest[k]), _plain(self.highest[k])]
                for k, label in enumerate(self.classes)
            },
        }


def novelty_of(table: FeatureTable, labels: Sequence[str]) -> Novelty:
    """Return what these training trials span."""
    values = table.values
    classes = tuple(sorted(set(labels)))
    given = np.array(labels)
    lowest = np.full((len(classes), len(table.names)), np.nan)
    highest = lowest.copy()
    squares, freedom = np.zeros(len(table.names)), np.zeros(len(table.names))
    for k, label in enumerate(classes):
        rows = values[given == label]
        for f in range(len(table.names)):
            known = rows[~np.isnan(rows[:, f]), f]
            if len(known):
                lowest[k, f], highest[k, f] = known.min(), known.max()
                squares[f] += float(((known - known.mean()) ** 2).sum())
                freedom[f] += len(known) - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        spread = np.sqrt(squares / freedom)
    for f in np.flatnonzero(freedom == 0).tolist():
        # One trial a class: what differs between classes is all there is to judge by.
        known = values[~np.isnan(values[:, f]), f]
        spread[f] = float(known.std()) if len(known) else math.nan
    return Novelty(
        names=table.names,
        units=table.units,
        classes=classes,
        lowest=lowest,
        highest=highest,
        spread=spread,
        featureless=bool(np.isnan(values).all(axis=1).any()),
    )


def novelty_from(names: Sequence[str], units: Sequence[str], kept: Mapping[str, Any]) -> Novelty:
    """Return what `to_json` gave. Raises KeyError, TypeError or ValueError where it is no such thing."""
    if kept["reach"] != REACH:
        raise ValueError(f"the rule for unknown things has reach {kept['reach']!r}, this version has {REACH}")
    classes = tuple(kept["ranges"])
    shape = (len(classes), len(names))
    lowest = np.array([kept["ranges"][label][0] for label in classes], dtype=np.float64).reshape(shape)
    highest = np.array([kept["ranges"][label][1] for label in classes], dtype=np.float64).reshape(shape)
    spread = np.array(kept["spread"], dtype=np.float64).reshape(shape[1:])
    return Novelty(
        names=tuple(names),
        units=tuple(units),
        classes=classes,
        lowest=lowest,
        highest=highest,
        spread=spread,
        featureless=bool(kept["featureless"]),
    )


def _worst(outside: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest along the last axis; infinite where nothing there is known."""
    known = ~np.isnan(outside)
    return np.where(known.any(axis=-1), np.where(known, outside, -1.0).max(axis=-1), np.inf)


def _plain(values: NDArray[np.float64]) -> list[float | None]:
    return [None if math.isnan(v) else v for v in values.tolist()]
