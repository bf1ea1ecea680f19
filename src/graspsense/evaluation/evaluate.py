"""Evaluating a classifier on labelled trials: its rate, with protocols, controls and a learning curve.

`docs/evaluation.md` defines every number.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from itertools import groupby
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.components.config import select_component
from graspsense.core.learn.labelled import TARGETS, ControlFeatures, Labelled, Target, class_of
from graspsense.core.values.errors import ConfigError, counted, listed
from graspsense.core.values.label_text import spelled_alike
from graspsense.evaluation.confusion import confusion
from graspsense.evaluation.crossval import ClassifierFactory, FitRefused, Groups, Pooled, cross_validate
from graspsense.evaluation.doubt import HeldOut
from graspsense.evaluation.folds import (
    INSTANCE_HELD_OUT,
    commonest,
    in_order,
    instance_held_out,
    stratified,
    trials_by_class,
)
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.intervals import (
    MIN_INSTANCES,
    Difference,
    RecognitionRate,
    difference,
    percentage,
    rate_among,
)
from graspsense.evaluation.results import CurvePoint, Evaluation, Measurement

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.values.features import FeatureTable
    from graspsense.evaluation.folds import Folds

SHARES: Final = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Shares of the training trials at which the learning curve is measured."""

PERMUTATIONS: Final = 19
"""Number of permutations of the labels, or numbers: the smallest with which p can be 0.05."""

Progress = Callable[[str, int, int], None]


def evaluate(
    learner: ClassifierFactory | str,
    labelled: Labelled,
    *,
    classifier: str = "",
    target: Target = "both",
    folds: int = 10,
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
    controls: bool = True,
    learning_curve: bool = True,
    permutations: int = PERMUTATIONS,
    progress: Progress | None = None,
) -> Evaluation:
    """Cross-validate a classifier on labelled trials, with controls and learning curve unless these are switched off.

    `learner` is the name of a classifier, or what makes one; `classifier` is its name in the result, by default that
    of the learner. `target` selects what is recognised: the label as it is (`both`), the class, or the state within
    each class. `permutations` is how often the labels are shuffled. Raises ConfigError if there is only one label, if
    there are too few trials, or if an argument is something else.
    """
    _check_arguments(labelled, target)
    if isinstance(learner, str):
        learner = select_component("classifier", learner)
    component = getattr(learner, "component", None)
    if not classifier:
        classifier = f"{component.qualified} {component.version}" if component else type(learner).__name__
    notes = list(labelled.notes)
    trials = _trials_for(labelled, target, notes)
    evaluator = _Evaluator(learner, trials, target, folds, seed, progress, notes)
    with gathered_warnings(notes):
        headline, protocols = evaluator.measure_protocols()
        measured = evaluator.measure_controls(headline, protocols, permutations) if controls else {}
        curve = evaluator.learning_curve(headline) if learning_curve else ()
    labels, table, held_out = trials.labels, trials.table, evaluator.held_out(headline)
    return Evaluation(
        source=labelled.source,
        classifier=classifier,
        settings=settings or {},
        target=target,
        features=tuple(zip(table.names, table.units, strict=True)),
        folds=folds,
        seed=seed,
        protocol=headline.protocol,
        headline=evaluator.rate(headline.pooled),
        confusion=confusion(labels, headline.pooled.predicted),
        protocols=protocols,
        controls=measured,
        by_class=evaluator.by_class(headline.pooled),
        by_features=evaluator.by_features(headline.pooled),
        unknown=evaluator.unknown(headline.pooled),
        learning_curve=curve,
        warnings=tuple(evaluator.warnings),
        notes=tuple(notes),
        confusions={
            name: confusion(labels, pooled.predicted) for name, pooled in evaluator.pooled_by_protocol.items()
        },
        sets=held_out.set_coverage(evaluator.rate_among),
        reliability=held_out.reliability(evaluator.rate_among),
    )


def _check_arguments(labelled: object, target: str) -> None:
    if not isinstance(labelled, Labelled):
        raise ConfigError(
            f"evaluate: expected a classifier, then trials, found {labelled!r:.100} as the trials: "
            "write evaluate('c45', load_trials('simulated'))"
        )
    if target not in TARGETS:
        raise ConfigError(f"target: expected {', '.join(map(repr, TARGETS))}, found {target!r}")


@frozen
class _Headline:
    """The predictions that the headline is about, with their protocol and folds.

    `assign` makes such folds for other labels of the same trials.
    """

    protocol: str
    pooled: Pooled
    folds: list[Folds]
    assign: Callable[[Sequence[str]], list[Folds]]


class _Evaluator:
    """The measurements of one evaluation. `warnings` and `notes` collect what a reader must know."""

    def __init__(
        self,
        learner: ClassifierFactory,
        trials: Labelled,
        target: Target,
        k: int,
        seed: int,
        progress: Progress | None,
        notes: list[str],
    ) -> None:
        self.learner, self.trials, self.k, self.seed = learner, trials, k, seed
        self.progress, self.notes = progress, notes
        self.labels = trials.labels
        self.rate_among = partial(rate_among, trials)
        self.groups = trials_by_class(self.labels, target)
        self._featureless = np.isnan(trials.table.values).all(axis=1)
        self.warnings: list[str] = []
        self.stratified_name = f"stratified_{k}_fold"
        self.pooled_by_protocol: dict[str, Pooled] = {}
        self.predicted_by_control: dict[str, tuple[Pooled, list[int]]] = {}
        """The predictions of the controls with other features, and the trials that these are of."""
        self._note_small_labels()
        self._note_instances()
        self._note_blocks()

    def measure_protocols(self) -> tuple[_Headline, dict[str, Measurement]]:
        """Measure the rate under each protocol. The headline holds out whole instances if that is possible."""

        def assign(labels: Sequence[str]) -> list[Folds]:
            return self._folds(lambda of_group, rows: stratified(of_group, self.k, self.seed), labels)

        folds = assign(self.labels)
        plain = self._pooled(self.stratified_name, self.trials.table, folds)
        headline = _Headline(self.stratified_name, plain, folds, assign)
        held, measured = self._instance_held_out(plain)
        if held is not None:
            self.pooled_by_protocol[INSTANCE_HELD_OUT] = held.pooled
        self.pooled_by_protocol[self.stratified_name] = plain
        what = f"{self.k} folds, stratified by label; predictions of all folds pooled"
        protocols = {
            INSTANCE_HELD_OUT: measured,
            self.stratified_name: Measurement(what, self.rate(plain)),
        }
        return held or headline, protocols

    def measure_controls(
        self, headline: _Headline, protocols: Mapping[str, Measurement], permutations: int
    ) -> dict[str, Measurement]:
        """Measure the controls, and warn if they show that the recording itself reveals the labels."""
        trials = self.trials
        opening = trials.first_line
        majority_correct, majority = self._majority(headline)
        controls = {
            "before_contact": self._other_features(
                "before_contact",
                trials.before_contact,
                headline,
                "features from before contact only",
                trials.no_before_contact,
            ),
            **(
                {}
                if opening is None
                else {"first_line": self._other_features("first_line", opening, headline)}
            ),
            "width_only": self._other_features(
                "width_only", trials.width, headline, "the width alone", trials.no_width
            ),
            INSTANCE_HELD_OUT: protocols[INSTANCE_HELD_OUT],
            "recording_order": self._in_order(),
            "majority_class": majority,
            "shuffled_labels": self._shuffled(headline, permutations),
        }
        for name, control in trials.variants.items():
            controls[name] = self._other_features(name, control, headline)
        self._warn_of_early_recognition(controls, majority_correct)
        self._warn_of_leaks(controls)
        self._warn_of_width(controls["width_only"], headline)
        return controls

    def learning_curve(self, headline: _Headline) -> tuple[CurvePoint, ...]:
        """Measure the rate for growing shares of the training trials."""
        points: list[CurvePoint] = []
        for share in SHARES:
            pooled = headline.pooled
            if share < 1.0:
                name = f"learning curve {share:.0%}"
                try:
                    pooled = self._pooled(name, self.trials.table, headline.folds, share)
                except FitRefused as refusal:
                    self.notes.append(
                        f"the learning curve has no point at {share:.0%} of the trials: {refusal}"
                    )
                    continue
            # At least one trial per label is used, so small shares of few trials may be the same trials.
            if not points or pooled.trained_on > points[-1].trained_on:
                points.append(CurvePoint(pooled.trained_on, self.rate(pooled)))
        return tuple(points)

    def rate(self, pooled: Pooled) -> RecognitionRate:
        """Return the rate of these predictions."""
        return self.rate_among(pooled.right(self.labels))

    def by_class(self, pooled: Pooled) -> dict[str, RecognitionRate]:
        """Return the rate among the trials of each class."""
        right = pooled.right(self.labels)
        rows: dict[str, list[int]] = {}
        for i, label in enumerate(self.labels):
            rows.setdefault(class_of(label), []).append(i)
        return {name: self.rate_among(right, of_class) for name, of_class in sorted(rows.items())}

    def unknown(self, pooled: Pooled) -> RecognitionRate:
        """Return the share of trials that the model of their fold calls unknown, or that have no feature at all."""
        return self.rate_among((pooled.unlike | self._featureless).tolist())

    def held_out(self, headline: _Headline) -> HeldOut:
        """Return the predictions of the headline, with the instances that its folds hold out, if they hold out any."""
        return HeldOut(
            pooled=headline.pooled,
            labels=self.labels,
            instances=self.trials.instances if headline.protocol == INSTANCE_HELD_OUT else None,
            groups=self.groups,
            folds=headline.folds,
        )

    def by_features(self, pooled: Pooled) -> dict[str, RecognitionRate]:
        """Return the rates among trials with features and without any; nothing if all trials have features."""
        if not self._featureless.any():
            return {}
        right = pooled.right(self.labels)
        chosen = {"with features": ~self._featureless, "without any feature": self._featureless}
        return {
            name: self.rate_among(right, np.flatnonzero(chosen_trials).tolist())
            for name, chosen_trials in chosen.items()
            if chosen_trials.any()
        }

    def _difference(
        self, minuend: Sequence[bool], subtrahend: Sequence[bool], rows: Sequence[int] | None = None
    ) -> Difference:
        """Return the difference of two rates on these trials (default: all)."""
        instances = self.trials.instances
        rows = range(len(minuend)) if rows is None else rows
        return difference(
            [minuend[i] for i in rows],
            [subtrahend[i] for i in rows],
            None if instances is None else [instances[i] for i in rows],
        )

    def _note_small_labels(self) -> None:
        counts = Counter(self.labels)
        single = sorted(label for label, n in counts.items() if n == 1)
        few = sorted(label for label, n in counts.items() if 1 < n < self.k)
        if single:
            self.notes.append(f"labels with a single trial, which no fold can predict: {', '.join(single)}")
        if few:
            self.notes.append(f"labels with fewer trials than folds ({self.k}): {', '.join(few)}")

    def _note_instances(self) -> None:
        """Note what makes the instances of these trials less than other objects."""
        if self.trials.instances is None:
            return
        count = len(set(self.trials.instances))
        if count < MIN_INSTANCES:
            self.notes.append(
                f"{counted(count, 'instance')}: with fewer than {MIN_INSTANCES}, rates and differences have "
                "no interval, and the controls give no warning"
            )
        if count == len(self.labels) and not self.trials.provenance.get("simulated"):
            self.notes.append(
                "each trial has an instance of its own: if these are numbers of trials, grasps of the same object are "
                "in training and test, and the rate is not that of other objects"
            )
        if pairs := spelled_alike(self.trials.instances):
            alike = listed([f"{name!r} and {other!r}" for name, other in pairs])
            self.notes.append(
                f"instances that differ in spelling only count as two: {alike}. If they are one object, its grasps are "
                "in training and test"
            )

    def _note_blocks(self) -> None:
        """Note that drift can tell recorded labels, and that no control shows it, where each label is one block."""
        order = self.trials.order
        if order is None or self.trials.provenance.get("simulated"):
            return
        in_time = [self.labels[i] for i in np.argsort(order, kind="stable").tolist()]
        blocks = sum(1 for _ in groupby(in_time))
        if blocks == len(set(in_time)) < len(in_time):
            self.notes.append(
                "in the order of recording, the trials of each label are one block: what changes with time, such as a "
                "temperature or the zero of a sensor, may tell the labels, and recording_order cannot show it. Grasp "
                "the objects in turn"
            )

    def _folds(
        self, assign: Callable[[Sequence[str], Any], Folds], labels: Sequence[str] | None = None
    ) -> list[Folds]:
        """Return the folds of each group, for these labels (default: those of the trials)."""
        labels = self.labels if labels is None else labels
        return [assign([labels[i] for i in rows], rows) for rows in self.groups]

    def _pooled(
        self,
        name: str,
        table: FeatureTable,
        folds: Sequence[Folds],
        share: float = 1.0,
        labels: Sequence[str] | None = None,
        groups: Groups | None = None,
    ) -> Pooled:
        """Cross-validate and report progress under this name. Raises FitRefused."""
        labels = self.labels if labels is None else labels
        groups = self.groups if groups is None else groups
        total = sum(int(fold.max()) + 1 for fold in folds)
        done = 0

        def step() -> None:
            nonlocal done
            done += 1
            if self.progress is not None:
                self.progress(name, done, total)

        return cross_validate(
            self.learner, table, labels, groups, folds, seed=self.seed, share=share, progress=step
        )

    def _against(
        self, what: str, pooled: Pooled, other: Pooled, other_name: str, rows: Sequence[int] | None = None
    ) -> Measurement:
        """Return the rate of `pooled` with its difference to another protocol, both on these trials (default: all)."""
        right = pooled.right(self.labels)
        by = self._difference(other.right(self.labels), right, rows)
        return Measurement(what, self.rate_among(right, rows), difference=by, difference_of=other_name)

    def _instance_held_out(self, plain: Pooled) -> tuple[_Headline | None, Measurement]:
        what = f"at most {self.k} folds of whole instances: no model was trained on the object that it is tested on"
        instances = self.trials.instances
        if instances is None:
            return None, Measurement(what, reason=self.trials.no_instances or "no instances are named")
        of_label: dict[str, set[str]] = {}
        for instance, label in zip(instances, self.labels, strict=True):
            of_label.setdefault(label, set()).add(instance)
        single = sorted(label for label, objects in of_label.items() if len(objects) == 1)
        if single:
            reason = f"labels with a single instance, which cannot be held out: {', '.join(single)}"
            return None, Measurement(what, reason=reason)

        def assign(labels: Sequence[str]) -> list[Folds]:
            return self._folds(
                lambda of_group, rows: instance_held_out(
                    of_group, [instances[i] for i in rows], self.k, self.seed
                ),
                labels,
            )

        folds = assign(self.labels)
        try:
            held = self._pooled(INSTANCE_HELD_OUT, self.trials.table, folds)
        except FitRefused as refusal:
            return None, Measurement(what, reason=str(refusal))
        headline = _Headline(INSTANCE_HELD_OUT, held, folds, assign)
        return headline, self._against(what, held, plain, self.stratified_name)

    def _in_order(self) -> Measurement:
        what = f"{self.k} folds; each is a block of every label's trials in the order of recording"
        order = self.trials.order
        if order is None:
            return Measurement(what, reason=self.trials.no_order or "the order of recording is not known")
        folds = self._folds(lambda labels, rows: in_order(labels, [order[i] for i in rows], self.k))
        try:
            blocks = self._pooled("recording_order", self.trials.table, folds)
        except FitRefused as refusal:
            return Measurement(what, reason=str(refusal))
        plain = self.pooled_by_protocol[self.stratified_name]
        return self._against(what, blocks, plain, self.stratified_name)

    def _other_features(
        self,
        name: str,
        control: ControlFeatures | None,
        headline: _Headline,
        default: str = "",
        reason: str = "",
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
        groups, folds = _among(having, self.groups, headline.folds)
        if not groups:
            return Measurement(control.what, reason=f"{having_words}; these are too few to learn from")
        try:
            pooled = self._pooled(name, control.table, folds, groups=groups)
        except FitRefused as refusal:
            return Measurement(control.what, reason=str(refusal))
        rows = np.sort(np.concatenate(list(groups))).tolist()
        self.predicted_by_control[name] = (pooled, rows)
        what = control.what if len(rows) == len(having) else f"{control.what}; {having_words}"
        return self._against(what, pooled, headline.pooled, headline.protocol, rows)

    def _majority(self, headline: _Headline) -> tuple[list[bool], Measurement]:
        """Return which trials have the most frequent label of their group, and the rate of predicting that label."""
        correct = np.zeros(len(self.labels), dtype=np.bool_)
        for rows in self.groups:
            most = commonest([self.labels[i] for i in rows])
            correct[rows] = [self.labels[i] == most for i in rows]
        what = "always the most frequent label"
        if len(self.groups) > 1:
            what += " (the most frequent state of each class)"
        return correct.tolist(), Measurement(
            what,
            self.rate_among(correct.tolist()),
            difference=self._difference(headline.pooled.right(self.labels), correct.tolist()),
            difference_of=headline.protocol,
        )

    def _shuffled(self, headline: _Headline, permutations: int) -> Measurement:
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
        rng = np.random.default_rng(self.seed)
        counts = []
        for k in range(permutations):
            shuffled = self._permuted(rng)
            name = f"shuffled_labels {k + 1}/{permutations}"
            try:
                folds = headline.assign(shuffled)
                pooled = self._pooled(name, self.trials.table, folds, labels=shuffled)
            except FitRefused as refusal:
                return Measurement(what, reason=str(refusal))
            counts.append(sum(pooled.right(shuffled)))
        reached = self.rate(headline.pooled).correct
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
        for rows in self.groups:
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
        for name, when in (
            ("before_contact", "before contact"),
            ("first_line", "the first line of the recording"),
        ):
            control = controls.get(name)
            if control is None or control.rate is None:
                continue
            pooled, rows = self.predicted_by_control[name]
            if self._difference(pooled.right(self.labels), majority_correct, rows).is_positive:
                majority = float(np.mean([majority_correct[i] for i in rows]))
                self.warnings.append(
                    f"{percentage(control.rate.rate)} of {counted(control.rate.n, 'trial is', 'trials are')} "
                    f"recognised from {when} ({control.what}); the most frequent label alone gives "
                    f"{percentage(majority)}. The recording itself reveals the labels"
                )

    def _warn_of_width(self, control: Measurement, headline: _Headline) -> None:
        """Warn if the width alone may be as good as all features."""
        by = control.difference
        if control.rate is not None and by is not None and by.interval is not None and not by.is_positive:
            self.warnings.append(
                f"the width alone reaches {percentage(control.rate.rate)} of {counted(control.rate.n, 'trial')}, and "
                f"the rate of {headline.protocol} is not shown to be higher (by {by.words}): the squeeze is not "
                "shown to add anything"
            )

    def _warn_of_leaks(self, controls: Mapping[str, Measurement]) -> None:
        for name, why in (
            (INSTANCE_HELD_OUT, "part of the stratified rate comes from having seen the same objects"),
            ("recording_order", "part of the stratified rate comes from the time of recording"),
        ):
            by = controls[name].difference
            if by is not None and by.is_positive and (name != INSTANCE_HELD_OUT or self._objects_differ()):
                self.warnings.append(f"the rate of {name} is lower by {by.words}: {why}")

    def _objects_differ(self) -> bool:
        """Return whether objects are recognised less often than groups of as many random trials of the same labels.

        Any group that is held out is recognised less often than single trials are, since its label is rarer among the
        training trials.
        """
        instances = np.array(self.trials.instances)
        labels, rng = np.array(self.labels), np.random.default_rng(self.seed)
        for label in self.trials.classes:
            rows = np.flatnonzero(labels == label)
            instances[rows] = rng.permutation(instances[rows])
        folds = self._folds(
            lambda of_group, rows: instance_held_out(of_group, instances[rows].tolist(), self.k, self.seed)
        )
        try:
            pooled = self._pooled("random groups", self.trials.table, folds)
        except FitRefused:
            return False
        held = self.pooled_by_protocol[INSTANCE_HELD_OUT]
        return self._difference(pooled.right(self.labels), held.right(self.labels)).is_positive


def _among(
    having: NDArray[np.bool_], groups: Groups, folds: Sequence[Folds]
) -> tuple[list[NDArray[np.int64]], list[Folds]]:
    """Return groups and folds of the trials in a mask, without groups that are not in several folds."""
    kept_groups, kept_folds = [], []
    for rows, fold in zip(groups, folds, strict=True):
        kept = having[rows]
        if len(np.unique(fold[kept])) > 1:
            kept_groups.append(rows[kept])
            kept_folds.append(fold[kept])
    return kept_groups, kept_folds


def _trials_for(labelled: Labelled, target: Target, notes: list[str]) -> Labelled:
    """Return the trials with the labels that the target asks for.

    Raises ConfigError if there are not at least two labels, or if a target `state` finds labels without a state.
    """
    if target == "class":
        labelled = labelled.aimed("class")
    elif target == "state":
        labelled = _with_several_states(labelled, notes)
    if len(labelled.classes) < 2:
        raise ConfigError(
            f"every trial of {labelled.source} has the label {labelled.labels[0]!r}: there is nothing to tell apart"
        )
    return labelled


def _with_several_states(labelled: Labelled, notes: list[str]) -> Labelled:
    """Return the trials of the classes that have more than one state."""
    labelled.aimed("state")  # raises ConfigError if a label has no state
    states: dict[str, set[str]] = {}
    for label in labelled.labels:
        states.setdefault(class_of(label), set()).add(label)
    single = sorted(name for name, state in states.items() if len(state) == 1)
    if not single:
        return labelled
    notes.append(f"classes left out because they have a single state: {', '.join(single)}")
    rows = [i for i, label in enumerate(labelled.labels) if class_of(label) not in single]
    if not rows:
        raise ConfigError(
            f"every class in {labelled.source} has a single state: there is nothing to tell apart"
        )
    return labelled.rows(np.array(rows, dtype=np.int64))
