"""The measurements of an evaluation: rates by cross-validation under each protocol, and the learning curve."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Final

import numpy as np
from attrs import define, evolve, frozen

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.labelled import Labelled, Target, class_of
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.label_text import natural_order
from graspsense.evaluation.crossval import ClassifierFactory, FitRefused, cross_validate
from graspsense.evaluation.doubt import HeldOut
from graspsense.evaluation.folds import (
    Folds,
    held_out_protocol,
    held_out_words,
    instance_held_out,
    stratified,
    trials_by_class,
)
from graspsense.evaluation.intervals import Difference, RecognitionRate, difference, rate_among
from graspsense.evaluation.results import CurvePoint, Measurement

SHARES: Final = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Shares of the training trials at which the learning curve is measured."""

Progress = Callable[[str, int, int], None]


@frozen
class Headline:
    """The predictions that the headline is about, with their protocol and folds.

    `assign` makes such folds for other labels of the same trials.
    """

    protocol: str
    pooled: Answers
    folds: Folds
    assign: Callable[[Sequence[str]], Folds]


@define(eq=False, slots=False)
class Evaluator:
    """The measurements of one evaluation. `notes` collects what a reader must know."""

    learner: ClassifierFactory
    trials: Labelled
    target: Target
    k: int
    seed: int
    progress: Progress | None
    notes: list[str]

    def __attrs_post_init__(self) -> None:
        self.labels = self.trials.labels
        self.rate_among = partial(rate_among, self.trials, folds=self.k)
        self.groups = trials_by_class(self.labels, self.target)
        """Trials that are cross-validated separately: all of them, or those of each class."""
        self.within = np.zeros(len(self.labels), dtype=np.int64)
        for number, rows in enumerate(self.groups):
            self.within[rows] = number
        self._featureless = np.isnan(self.trials.table.values).all(axis=1)
        self.stratified_name = f"stratified_{self.k}_fold"
        self.held_out_name = held_out_protocol(self.trials)
        self.pooled_by_protocol: dict[str, Answers] = {}

    def measure_protocols(self) -> tuple[Headline, dict[str, Measurement]]:
        """Measure the rate under each protocol. The headline holds out whole instances if that is possible."""

        def assign(labels: Sequence[str]) -> Folds:
            return self.assigned_folds(lambda of_group, rows: stratified(of_group, self.k, self.seed), labels)

        folds = assign(self.labels)
        plain = self.pooled(self.stratified_name, self.trials.table, folds)
        headline = Headline(self.stratified_name, plain, folds, assign)
        held, measured = self._instance_held_out(plain)
        if held is not None:
            self.pooled_by_protocol[self.held_out_name] = held.pooled
        self.pooled_by_protocol[self.stratified_name] = plain
        what = f"{self.k} folds, stratified by label; predictions of all folds pooled"
        protocols = {
            self.held_out_name: measured,
            self.stratified_name: Measurement(what, self.rate(plain)),
        }
        return held or headline, protocols

    def learning_curve(self, headline: Headline) -> tuple[CurvePoint, ...]:
        """Measure the rate for growing shares of the training trials."""
        points: list[CurvePoint] = []
        for share in SHARES:
            pooled = headline.pooled
            if share < 1.0:
                name = f"learning curve {100 * share:.0f} %"
                try:
                    pooled = self.pooled(name, self.trials.table, headline.folds, share)
                except FitRefused as refusal:
                    self.notes.append(
                        f"the learning curve has no point at {100 * share:.0f} % of the trials: {refusal}"
                    )
                    continue
            # At least one trial per label is used, so small shares of few trials may be the same trials.
            if not points or pooled.trained_on > points[-1].trained_on:
                points.append(CurvePoint(pooled.trained_on, self.rate(pooled)))
        return tuple(points)

    def rate(self, pooled: Answers) -> RecognitionRate:
        """Return the rate of these predictions."""
        return self.rate_among(pooled.right(self.labels))

    def by_class(self, pooled: Answers) -> dict[str, RecognitionRate]:
        """Return the rate among the trials of each class."""
        right, classes = pooled.right(self.labels), np.array([class_of(label) for label in self.labels])
        return {
            name: self.rate_among(right, np.flatnonzero(classes == name).tolist())
            for name in natural_order(classes.tolist())
        }

    def unknown(self, pooled: Answers) -> RecognitionRate:
        """Return the share of trials that the model of their fold calls unknown, or that have no feature at all."""
        return self.rate_among((pooled.unlike | self._featureless).tolist())

    def held_out(self, headline: Headline) -> HeldOut:
        """Return the predictions of the headline, with the instances that its folds hold out, if they hold out any."""
        named = headline.protocol == self.held_out_name
        trials = self.trials if named else evolve(self.trials, instances=None)
        return HeldOut(answers=headline.pooled, trials=trials, folds=headline.folds, within=self.within)

    def by_features(self, pooled: Answers) -> dict[str, RecognitionRate]:
        """Return the rates among trials with features and without any; nothing if all trials have features."""
        chosen = {"with features": ~self._featureless, "without any feature": self._featureless}
        right = pooled.right(self.labels)
        rows = {name: np.flatnonzero(which) for name, which in chosen.items()}
        among = {name: self.rate_among(right, which.tolist()) for name, which in rows.items() if len(which)}
        return among if self._featureless.any() else {}

    def difference(
        self, minuend: Sequence[bool], subtrahend: Sequence[bool], rows: Sequence[int] | None = None
    ) -> Difference:
        """Return the difference of two rates on these trials (default: all)."""
        instances = self.trials.instances
        rows = range(len(minuend)) if rows is None else rows
        return difference(
            [minuend[i] for i in rows],
            [subtrahend[i] for i in rows],
            None if instances is None else [instances[i] for i in rows],
            folds=self.k,
        )

    def assigned_folds(
        self, assign: Callable[[Sequence[str], Any], Folds], labels: Sequence[str] | None = None
    ) -> Folds:
        """Return the folds of all groups, for these labels (default: those of the trials)."""
        labels = self.labels if labels is None else labels
        folds = np.full(len(labels), -1, dtype=np.int64)
        for rows in self.groups:
            folds[rows] = int(folds.max()) + 1 + assign([labels[i] for i in rows], rows)
        return folds

    def pooled(
        self,
        name: str,
        table: FeatureTable,
        folds: Folds,
        share: float = 1.0,
        labels: Sequence[str] | None = None,
    ) -> Answers:
        """Cross-validate and report progress under this name. Raises FitRefused."""
        labels = self.labels if labels is None else labels
        total, done = len(np.unique(folds[folds >= 0])), 0

        def step() -> None:
            nonlocal done
            done += 1
            if self.progress is not None:
                self.progress(name, done, total)

        return cross_validate(
            self.learner, table, labels, folds, self.within, seed=self.seed, share=share, progress=step
        )

    def against(
        self, what: str, pooled: Answers, other: Answers, other_name: str, rows: Sequence[int] | None = None
    ) -> Measurement:
        """Return the rate of `pooled` and its difference from another protocol, on these trials (default: all)."""
        right = pooled.right(self.labels)
        by = self.difference(other.right(self.labels), right, rows)
        return Measurement(what, self.rate_among(right, rows), difference=by, difference_of=other_name)

    def _instance_held_out(self, plain: Answers) -> tuple[Headline | None, Measurement]:
        what = held_out_words(self.trials, self.k)
        instances = self.trials.instances
        if instances is None:
            return None, Measurement(what, reason=self.trials.no_instances or "no instances are named")
        of_label: dict[str, set[str]] = {}
        for instance, label in zip(instances, self.labels, strict=True):
            of_label.setdefault(label, set()).add(instance)
        single = natural_order(label for label, objects in of_label.items() if len(objects) == 1)
        if single:
            reason = f"labels with a single instance, which cannot be held out: {', '.join(single)}"
            return None, Measurement(what, reason=reason)

        def assign(labels: Sequence[str]) -> Folds:
            return self.assigned_folds(
                lambda of_group, rows: instance_held_out(
                    of_group, [instances[i] for i in rows], self.k, self.seed
                ),
                labels,
            )

        folds = assign(self.labels)
        try:
            held = self.pooled(self.held_out_name, self.trials.table, folds)
        except FitRefused as refusal:
            return None, Measurement(what, reason=str(refusal))
        headline = Headline(self.held_out_name, held, folds, assign)
        return headline, self.against(what, held, plain, self.stratified_name)
