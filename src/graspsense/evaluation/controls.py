"""The controls of an evaluation: what is recognised where nothing should be, and what that says of the trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.labelled import ControlFeatures
from graspsense.core.values.errors import counted
from graspsense.evaluation.crossval import FitRefused
from graspsense.evaluation.evaluator import Evaluator, Headline
from graspsense.evaluation.folds import commonest, in_order, instance_held_out, splits
from graspsense.evaluation.intervals import RecognitionRate, percent, rate_among
from graspsense.evaluation.results import Measurement

PERMUTATIONS: Final = 19
"""Number of permutations of the labels: the smallest with which p can be 0.05."""
EARLY: Final = {"before_contact": "before contact", "first_line": "the first line of the recording"}
"""The controls with features from before the squeeze, and from when these are."""


class ControlMeasurements:
    """The controls of one evaluation, beside its headline. `warnings` collect what they show."""

    def __init__(self, evaluator: Evaluator, headline: Headline) -> None:
        self.evaluator, self.headline = evaluator, headline
        self.trials, self.labels = evaluator.trials, evaluator.labels
        self.warnings: list[str] = []
        self.predicted: dict[str, tuple[Answers, list[int]]] = {}
        """The predictions of the controls with other features, and the trials that these are of."""

    def measure(self, protocols: Mapping[str, Measurement], permutations: int) -> dict[str, Measurement]:
        """Measure the controls, and warn if they show that the recording itself reveals the labels."""
        majority_correct, majority = self._majority()
        controls = {
            **{features[0]: self._other_features(*features) for features in self.trials.other_features()},
            self.evaluator.held_out_name: protocols[self.evaluator.held_out_name],
            "recording_order": self._in_order(),
            "majority_class": majority,
            "shuffled_labels": self._shuffled(permutations),
        }
        self._warn_of_early_recognition(controls, majority_correct)
        self._warn_of_leaks(controls)
        self._warn_of_width(controls["width_only"])
        return controls

    def _in_order(self) -> Measurement:
        what = f"{self.evaluator.k} folds; each is a block of every label's trials in the order of recording"
        order = self.trials.order
        if order is None:
            return Measurement(what, reason=self.trials.no_order or "the order of recording is not known")
        folds = self.evaluator.assigned_folds(
            lambda labels, rows: in_order(labels, [order[i] for i in rows], self.evaluator.k)
        )
        try:
            blocks = self.evaluator.pooled("recording_order", self.trials.table, folds)
        except FitRefused as refusal:
            return Measurement(what, reason=str(refusal))
        plain = self.evaluator.pooled_by_protocol[self.evaluator.stratified_name]
        return self.evaluator.against(what, blocks, plain, self.evaluator.stratified_name)

    def _other_features(
        self, name: str, control: ControlFeatures | None, default: str, reason: str
    ) -> Measurement:
        """Measure the rate with other features on the folds of the headline, among the trials that have any of them.

        Trials without such a feature would be given the most frequent label, so that a control could seem to pass
        because it measured nothing.
        """
        if control is None:
            return Measurement(default, reason=reason or "these trials have no such features")
        having, having_words = control.having, control.having_words
        if not having.any():
            return Measurement(control.what, reason=having_words)
        folds = np.where(having, self.headline.folds, -1)
        tested = [test for test, _ in splits(folds, self.evaluator.within)]
        if not tested:
            return Measurement(control.what, reason=f"{having_words}; these are too few to learn from")
        try:
            pooled = self.evaluator.pooled(name, control.table, folds)
        except FitRefused as refusal:
            return Measurement(control.what, reason=str(refusal))
        rows = np.sort(np.concatenate(tested)).tolist()
        self.predicted[name] = (pooled, rows)
        what = control.what if len(rows) == len(having) else f"{control.what}; {having_words}"
        return self.evaluator.against(what, pooled, self.headline.pooled, self.headline.protocol, rows)

    def _majority(self) -> tuple[list[bool], Measurement]:
        """Return which trials have the most frequent label of their group, and the rate of predicting that label."""
        correct = np.zeros(len(self.labels), dtype=np.bool_)
        for rows in self.evaluator.groups:
            most = commonest([self.labels[i] for i in rows])
            correct[rows] = [self.labels[i] == most for i in rows]
        what = "always the most frequent label"
        if len(self.evaluator.groups) > 1:
            what += " (the most frequent state of each class)"
        return correct.tolist(), Measurement(
            what,
            rate_among(self.trials, correct.tolist()),
            difference=self.evaluator.difference(self.headline.pooled.right(self.labels), correct.tolist()),
            difference_of=self.headline.protocol,
        )

    def _shuffled(self, permutations: int) -> Measurement:
        """Measure the rate on labels that carry no information, and the permutation p of the headline.

        The labels of whole instances are exchanged, so that shuffled trials depend on each other as the real ones do.
        The folds are stratified by the shuffled labels: in those of the real ones, a label that is frequent in a fold
        would be rare in its training trials, so that shuffled rates would be too low.
        p is (b + 1) / (m + 1), with b of m permutations at least as good as the headline (B. Phipson and G. K. Smyth,
        Stat. Appl. Genet. Mol. Biol. 9 (2010) 39).
        """
        what = f"mean of {permutations} permutations of the labels, each in folds like those of the headline"
        if permutations < 1:
            return Measurement(what, reason="no permutation was asked for")
        rng = np.random.default_rng(self.evaluator.seed)
        counts = []
        for k in range(permutations):
            shuffled = self._permuted(rng)
            name = f"shuffled_labels {k + 1}/{permutations}"
            try:
                folds = self.headline.assign(shuffled)
                pooled = self.evaluator.pooled(name, self.trials.table, folds, labels=shuffled)
            except FitRefused as refusal:
                return Measurement(what, reason=str(refusal))
            counts.append(sum(pooled.right(shuffled)))
        reached = self.evaluator.rate(self.headline.pooled).correct
        p = None
        if permutations >= PERMUTATIONS:
            p = (sum(count >= reached for count in counts) + 1) / (len(counts) + 1)
            what += f"; permutation p of the headline: {p:.2g}"
        no_interval = "a mean over permutations"
        rate = RecognitionRate(round(sum(counts) / len(counts)), len(self.labels), None, no_interval)
        return Measurement(what, rate, permutation_p=p)

    def _permuted(self, rng: np.random.Generator) -> list[str]:
        """Return the labels exchanged among the instances of each group; among its trials if no instances are known."""
        labels = np.array(self.labels)
        for rows in self.evaluator.groups:
            if self.trials.instances is None:
                labels[rows] = rng.permutation(labels[rows])
                continue
            instances = np.array(self.trials.instances)[rows]
            blocks = [rows[instances == name] for name in np.unique(instances)]
            order = rng.permutation(len(blocks))
            given = np.concatenate([rng.permutation(labels[blocks[k]]) for k in order])
            labels[np.concatenate([blocks[k] for k in rng.permutation(len(blocks))])] = given
        return [str(label) for label in labels]

    def _warn_of_early_recognition(
        self, controls: Mapping[str, Measurement], majority_correct: Sequence[bool]
    ) -> None:
        for name, when in EARLY.items():
            control = controls.get(name)
            if control is None or control.rate is None:
                continue
            pooled, rows = self.predicted[name]
            if self.evaluator.difference(pooled.right(self.labels), majority_correct, rows).is_positive:
                majority = float(np.mean([majority_correct[i] for i in rows]))
                self.warnings.append(
                    f"{percent(control.rate.rate)} of {counted(control.rate.n, 'trial is', 'trials are')} "
                    f"recognised from {when} ({control.what}); the most frequent label alone gives "
                    f"{percent(majority)}. The recording itself reveals the labels"
                )

    def _warn_of_width(self, control: Measurement) -> None:
        """Warn if the width alone may be as good as all features."""
        by = control.difference
        if control.rate is not None and by is not None and by.interval is not None and not by.is_positive:
            self.warnings.append(
                f"the width alone reaches {percent(control.rate.rate)} of {counted(control.rate.n, 'trial')}, and "
                f"the rate of {self.headline.protocol} is not shown to be higher (by {by.words}): the squeeze is not "
                "shown to add anything"
            )

    def _warn_of_leaks(self, controls: Mapping[str, Measurement]) -> None:
        held_out = self.evaluator.held_out_name
        for name, why in (
            (held_out, "part of the stratified rate comes from having seen the same objects"),
            ("recording_order", "part of the stratified rate comes from the time of recording"),
        ):
            by = controls[name].difference
            if by is not None and by.is_positive and (name != held_out or self._objects_differ()):
                self.warnings.append(f"the rate of {name} is lower by {by.words}: {why}")

    def _objects_differ(self) -> bool:
        """Return whether objects are recognised less often than groups of as many random trials of the same labels.

        Any group that is held out is recognised less often than single trials are, since its label is rarer among the
        training trials.
        """
        evaluator = self.evaluator
        instances = np.array(self.trials.instances)
        labels, rng = np.array(self.labels), np.random.default_rng(evaluator.seed)
        for label in self.trials.classes:
            rows = np.flatnonzero(labels == label)
            instances[rows] = rng.permutation(instances[rows])
        folds = evaluator.assigned_folds(
            lambda of_group, rows: instance_held_out(
                of_group, instances[rows].tolist(), evaluator.k, evaluator.seed
            )
        )
        try:
            pooled = evaluator.pooled("random groups", self.trials.table, folds)
        except FitRefused:
            return False
        held = evaluator.pooled_by_protocol[evaluator.held_out_name]
        return evaluator.difference(pooled.right(self.labels), held.right(self.labels)).is_positive
