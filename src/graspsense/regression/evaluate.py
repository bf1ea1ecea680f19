"""Evaluating predicted numbers by cross-validation, with the controls that rates of labels have.

`docs/evaluation.md` defines every number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from functools import cached_property, partial

import numpy as np
from attrs import define, field, frozen
from numpy.typing import NDArray

from graspsense.core.learn.conformal import COVERAGE
from graspsense.core.learn.labelled import ControlFeatures, Labelled
from graspsense.core.values.errors import counted
from graspsense.core.values.units import with_unit
from graspsense.evaluation.controls import EARLY
from graspsense.evaluation.evaluator import Progress
from graspsense.evaluation.folds import (
    Folds,
    held_out_protocol,
    held_out_words,
    in_order,
    instance_held_out,
    splits,
    stratified,
)
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.intervals import MIN_INSTANCES, Difference, rate_of
from graspsense.regression.estimators import FittedRegression, check_estimator, target_of
from graspsense.regression.intervals import intervals_of
from graspsense.regression.results import (
    IntervalCoverage,
    RegressionError,
    RegressionEvaluation,
    RegressionMeasurement,
    difference_of_errors,
    error_of,
)


def evaluate_regression(
    estimator: str,
    labelled: Labelled,
    *,
    folds: int = 10,
    seed: int = 0,
    progress: Progress | None = None,
) -> RegressionEvaluation:
    """Cross-validate an estimator on trials with a number to predict, `labelled.value`, with controls.

    Raises ConfigError for an unknown estimator, if there is no number or only one, or if there are too few trials.
    """
    check_estimator(estimator)
    target = target_of(labelled)
    notes = list(labelled.notes)
    evaluator = _Evaluator(estimator, labelled, np.array(target.values), folds, seed, progress)
    with gathered_warnings(notes):
        evaluator.measure_protocols()
        evaluator.measure_controls()
    headline = evaluator.headline
    if evaluator.instances is not None and len(set(evaluator.instances)) < MIN_INSTANCES:
        notes.append(
            f"{counted(len(set(evaluator.instances)), 'instance')}: with fewer than {MIN_INSTANCES}, errors and "
            "differences have no interval, and the controls give no warning"
        )
    table = labelled.table
    return RegressionEvaluation(
        source=labelled.source,
        estimator=estimator,
        target_value=target.name,
        unit=target.unit,
        features=tuple(zip(table.names, table.units, strict=True)),
        folds=folds,
        seed=seed,
        protocol=headline.name,
        headline=evaluator.error(headline),
        explained=evaluator.explained(),
        protocols=evaluator.protocols,
        controls=evaluator.controls,
        intervals=evaluator.interval_coverage(),
        predictions=tuple(zip(target.values, headline.predicted.tolist(), strict=True)),
        warnings=tuple(evaluator.warnings()),
        notes=tuple(notes),
    )


def held_out_predictions(
    estimator: str,
    features: NDArray[np.float64],
    values: NDArray[np.float64],
    folds: Folds,
    seed: int,
    progress: Callable[[int, int], None] | None = None,
) -> NDArray[np.float64]:
    """Return the prediction of each trial by an estimator that was fitted to the trials of the other folds.

    Folds whose training trials are fewer than two are predicted by their mean.
    """
    predicted = np.empty(len(values))
    divided = list(splits(folds))
    for done, (test, others) in enumerate(divided, 1):
        if len(others) < 2:
            predicted[test] = values[others].mean()
        else:
            fitted = FittedRegression(estimator, features[others], values[others], seed)
            predicted[test] = fitted.predict(features[test])
        if progress is not None:
            progress(done, len(divided))
    return predicted


@frozen(eq=False)
class _HeldOut:
    """Predictions of held-out trials: by which protocol or control, in which folds, and of which trials."""

    name: str
    predicted: NDArray[np.float64]
    folds: Folds
    rows: Sequence[int]


@define(eq=False)
class _Evaluator:
    """The measurements of one evaluation."""

    estimator: str
    trials: Labelled
    values: NDArray[np.float64]
    k: int
    seed: int
    progress: Progress | None
    held_out: dict[str, _HeldOut] = field(factory=dict)
    protocols: dict[str, RegressionMeasurement] = field(factory=dict)
    controls: dict[str, RegressionMeasurement] = field(factory=dict)
    plain: _HeldOut = field(init=False)
    headline: _HeldOut = field(init=False)
    mean: _HeldOut = field(init=False)

    @cached_property
    def instances(self) -> tuple[str, ...] | None:
        """The instances, where there are several."""
        named = self.trials.instances
        return None if named is None or len(set(named)) < 2 else named

    def measure_protocols(self) -> None:
        """Measure the error under each protocol. The headline holds out whole instances if they are known."""
        alike = [""] * len(self.values)
        self.plain = self.headline = self._predicted(f"{self.k}_fold", stratified(alike, self.k, self.seed))
        what, name = held_out_words(self.trials, self.k), held_out_protocol(self.trials)
        if self.instances is None:
            reason = self.trials.no_instances or "no instances are named"
            self.protocols[name] = RegressionMeasurement(what=what, reason=reason)
        else:
            folds = instance_held_out(alike, self.instances, self.k, self.seed)
            self.headline = self._predicted(name, folds)
            self.protocols[name] = self._against(what, self.headline, self.plain)
        self.protocols[self.plain.name] = RegressionMeasurement(
            what=f"{self.k} folds of shuffled trials", error=self.error(self.plain)
        )

    def measure_controls(self) -> None:
        """Measure what the number can be predicted from besides the squeeze."""
        folds = self.headline.folds
        mean = np.empty(len(self.values))
        for test, others in splits(folds):
            mean[test] = self.values[others].mean()
        self.mean = _HeldOut("mean_only", mean, folds, self.headline.rows)
        self.controls["mean_only"] = self._against(
            "always the mean of the training trials", self.mean, self.headline
        )
        for features in self.trials.other_features():
            self._other_features(*features)
        held_out_name = held_out_protocol(self.trials)
        self.controls[held_out_name] = self.protocols[held_out_name]
        self._in_order()

    def error(self, held: _HeldOut) -> RegressionError:
        """Return the error of these predictions."""
        errors = (held.predicted - self.values)[held.rows]
        return error_of(errors.tolist(), self._instances_of(held.rows), self.k)

    def explained(self) -> float | None:
        """Return 1 minus the squared errors over those of the mean."""
        ours, mean = (
            float(((held.predicted - self.values) ** 2).sum()) for held in (self.headline, self.mean)
        )
        return None if mean == 0.0 else 1.0 - ours / mean

    def interval_coverage(self) -> IntervalCoverage:
        """Return how often prediction intervals contain the true number; each fold is calibrated by the others."""
        unit = "trials" if self.instances is None else "instances"
        errors = self.headline.predicted - self.values
        inside = np.zeros(len(errors), dtype=np.bool_)
        radii = np.empty(len(errors))
        predicted = self.headline.predicted
        for test, others in splits(self.headline.folds):
            calibrated = intervals_of(predicted[others], errors[others], self._instances_of(others.tolist()))
            if calibrated.reason:
                return IntervalCoverage(asked=COVERAGE, unit=unit, reason=calibrated.reason)
            radii[test] = calibrated.half_width(predicted[test])
            inside[test] = np.abs(errors[test]) <= radii[test]
        return IntervalCoverage(
            asked=COVERAGE,
            unit=unit,
            covered=rate_of(inside.tolist(), self.instances, folds=self.k),
            mean_half_width=float(radii.mean()),
        )

    def warnings(self) -> Iterator[str]:
        """Yield what the controls say against the headline."""
        unit = self.trials.value.unit if self.trials.value is not None else ""
        if not _is_worse(self.controls["mean_only"]):
            yield "the error is not shown to be below that of always predicting the mean"
        for name, when in EARLY.items():
            held = self.held_out.get(name)
            if held is not None and self._difference(self.mean, held).is_positive:
                yield (
                    f"from {when} alone the error is {self.error(held).words(unit)}, below that of the mean: the "
                    "recording itself reveals the number"
                )
        width = self.controls["width_only"]
        if width.difference is not None and width.difference.interval is not None and not _is_worse(width):
            yield "the error with the width alone is not shown to be larger: the squeeze may not add anything"
        for name, what in {
            held_out_protocol(self.trials): "having seen the same objects",
            "recording_order": "the time of recording",
        }.items():
            by = self.controls[name].difference
            if by is not None and by.is_positive:
                yield (
                    f"the error of {name} is larger by {with_unit(f'{by.value:.4g}', unit)}: part of the accuracy "
                    f"within folds comes from {what}"
                )

    def _instances_of(self, rows: Sequence[int]) -> list[str] | None:
        return None if self.instances is None else [self.instances[i] for i in rows]

    def _predicted(
        self,
        name: str,
        folds: Folds,
        features: NDArray[np.float64] | None = None,
        rows: Sequence[int] | None = None,
    ) -> _HeldOut:
        """Cross-validate and report progress under this name. `rows`: the trials that take part (default: all)."""
        features = self.trials.table.values if features is None else features
        rows = range(len(self.values)) if rows is None else rows
        tell = None if self.progress is None else partial(self.progress, name)
        predicted = np.full(len(self.values), np.nan)
        predicted[rows] = held_out_predictions(
            self.estimator, features[rows], self.values[rows], folds[rows], self.seed, tell
        )
        held = self.held_out[name] = _HeldOut(name, predicted, folds, rows)
        return held

    def _difference(self, minuend: _HeldOut, subtrahend: _HeldOut) -> Difference:
        """Return the difference of two errors, on the trials of which there are both predictions."""
        rows = min(minuend.rows, subtrahend.rows, key=len)
        errors, others = ((held.predicted - self.values)[rows] for held in (minuend, subtrahend))
        return difference_of_errors(errors.tolist(), others.tolist(), self._instances_of(rows), self.k)

    def _against(self, what: str, held: _HeldOut, other: _HeldOut) -> RegressionMeasurement:
        """Return the error with its difference from another protocol."""
        error, by = self.error(held), self._difference(held, other)
        return RegressionMeasurement(what=what, error=error, difference=by, difference_of=other.name)

    def _other_features(self, name: str, control: ControlFeatures | None, default: str, reason: str) -> None:
        """Measure the error with other features, among the trials that have any of them."""
        if control is None:
            self.controls[name] = RegressionMeasurement(
                what=default, reason=reason or "these trials have no such features"
            )
            return
        rows = np.flatnonzero(control.having).tolist()
        words, folds = control.having_words, self.headline.folds
        if not rows or len(np.unique(folds[rows])) < 2:
            too_few = "; these are too few to learn from" if rows else ""
            self.controls[name] = RegressionMeasurement(what=control.what, reason=f"{words}{too_few}")
            return
        held = self._predicted(name, folds, control.table.values, rows)
        what = control.what if len(rows) == len(self.values) else f"{control.what}; {words}"
        self.controls[name] = self._against(what, held, self.headline)

    def _in_order(self) -> None:
        what = f"{self.k} folds; each is a block of trials in the order of recording"
        if self.trials.order is None:
            reason = self.trials.no_order or "the order of recording is not known"
            self.controls["recording_order"] = RegressionMeasurement(what=what, reason=reason)
            return
        folds = in_order([""] * len(self.values), self.trials.order, self.k)
        held = self._predicted("recording_order", folds)
        self.controls["recording_order"] = self._against(what, held, self.plain)


def _is_worse(control: RegressionMeasurement) -> bool:
    """Return whether the error of a control is shown to be larger than that which it is compared with."""
    return control.difference is not None and control.difference.is_positive
