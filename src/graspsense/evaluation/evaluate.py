"""A recognition rate with everything that is needed to judge it: protocols, controls, learning curve.

`docs/evaluation.md` says how each number is defined.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import field, frozen

from graspsense.core.errors import ConfigError
from graspsense.core.labelled import ControlFeatures, Labelled, Target, class_of
from graspsense.evaluation.confusion import Confusion, confusion
from graspsense.evaluation.crossval import FitRefused, Groups, Learner, Pooled, cross_validate
from graspsense.evaluation.folds import commonest, in_order, instance_held_out, stratified
from graspsense.evaluation.intervals import Difference, RecognitionRate, difference

if TYPE_CHECKING:
    from graspsense.core.features import FeatureTable
    from graspsense.evaluation.folds import Folds

INSTANCE_HELD_OUT: Final = "instance_held_out"
SHARES: Final = (0.1, 0.2, 0.4, 0.7, 1.0)
"""Parts of the training trials on which the learning curve is measured."""

Progress = Callable[[str, int, int], None]


@frozen
class Judged:
    """A rate that could be measured, or the reason why not.

    `what` defines it. `difference` is the rate that it is a control of, less this one.
    """

    what: str
    rate: RecognitionRate | None = None
    reason: str = ""
    difference: Difference | None = None
    of: str = ""
    """What `difference` starts from: the name of a protocol."""

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON; `rate` is None with a `reason` where it could not be measured."""
        if self.rate is None:
            return {"what": self.what, "rate": None, "reason": self.reason}
        found: dict[str, Any] = {"what": self.what, **rate_as_json(self.rate)}
        if self.difference is not None:
            found["difference"] = self.difference.value
            found["difference_interval"] = list(self.difference.interval)
            found["difference_of"] = f"{self.of} less this"
        return found


@frozen
class CurvePoint:
    """One point of the learning curve: the mean number of training trials, and the rate."""

    trained_on: float
    rate: RecognitionRate


@frozen(kw_only=True)
class Evaluation:
    """What `graspsense evaluate` found."""

    source: str
    classifier: str
    target: Target
    features: tuple[tuple[str, str], ...]
    protocol: str
    headline: RecognitionRate
    confusion: Confusion
    protocols: Mapping[str, Judged]
    controls: Mapping[str, Judged]
    by_class: Mapping[str, RecognitionRate]
    """Rate of the headline among the trials of each class (`class` of `class:state`)."""
    unlike: RecognitionRate
    """Held-out trials that the model of their fold would call unknown; here they are counted by their label."""
    learning_curve: tuple[CurvePoint, ...]
    warnings: tuple[str, ...]
    """What in the controls speaks against taking the headline for the object's."""
    notes: tuple[str, ...]
    folds: int
    seed: int
    settings: Mapping[str, Any] = field(factory=dict)
    confusions: Mapping[str, Confusion] = field(factory=dict)
    """The confusion matrix of each protocol that could be followed; `confusion` is that of the headline."""

    def as_json(self) -> dict[str, Any]:
        """Return what `graspsense evaluate --json` prints."""
        return {
            "source": self.source,
            "classifier": self.classifier,
            "settings": dict(self.settings),
            "target": self.target,
            "features": [name for name, _ in self.features],
            "units": dict(self.features),
            "folds": self.folds,
            "seed": self.seed,
            "protocol": self.protocol,
            **rate_as_json(self.headline),
            "labels": list(self.confusion.labels),
            "confusion": [list(row) for row in self.confusion.counts],
            "protocols": {name: one.as_json() for name, one in self.protocols.items()},
            "controls": {name: one.as_json() for name, one in self.controls.items()},
            "by_class": {name: rate_as_json(one) for name, one in self.by_class.items()},
            "unknown": rate_as_json(self.unlike),
            "learning_curve": [
                {"trained_on": one.trained_on, **rate_as_json(one.rate)} for one in self.learning_curve
            ],
            "warnings": list(self.warnings),
            "notes": list(self.notes),
        }


def rate_as_json(rate: RecognitionRate) -> dict[str, Any]:
    """Return a rate with its counts and interval."""
    return {"n": rate.n, "correct": rate.correct, "rate": rate.rate, "interval": list(rate.interval)}


def evaluate(
    learner: Learner,
    labelled: Labelled,
    *,
    classifier: str,
    target: Target = "both",
    folds: int = 10,
    seed: int = 0,
    settings: Mapping[str, Any] | None = None,
    controls: bool = True,
    learning_curve: bool = True,
    progress: Progress | None = None,
) -> Evaluation:
    """Judge a classifier on labelled trials, with the controls and the learning curve unless these are left out.

    `target` is what is recognised: the label as it is (`both`), the class, or the state among trials of one
    class, each class apart from the others. Raises ConfigError where there is nothing to tell apart, or too
    few trials.
    """
    judge = _Judge(learner, labelled, classifier, target, folds, seed, settings or {}, progress)
    return judge.judge(controls, learning_curve)


class _Judge:
    """What the measurements of one evaluation share."""

    def __init__(
        self,
        learner: Learner,
        labelled: Labelled,
        classifier: str,
        target: Target,
        folds: int,
        seed: int,
        settings: Mapping[str, Any],
        progress: Progress | None,
    ) -> None:
        self.learner, self.classifier, self.target = learner, classifier, target
        self.k, self.seed, self.settings, self.progress = folds, seed, settings, progress
        self.notes = list(labelled.notes)
        self.warnings: list[str] = []
        self.labelled = self._chosen(labelled)
        self.labels = self.labelled.labels
        self.groups: Groups = self._groups()
        self._note_small_labels()

    def judge(self, with_controls: bool, with_curve: bool) -> Evaluation:
        """Measure everything that is asked for."""
        labelled, table = self.labelled, self.labelled.table
        plain_name = f"stratified_{self.k}_fold"
        plain_what = f"{self.k} folds, stratified by label; predictions of all folds pooled"
        dealt = self._folds(lambda labels, rows: stratified(labels, self.k, self.seed))
        plain = self._pooled(plain_name, table, dealt)
        plain_judged = Judged(plain_what, self._rate(plain))
        protocols = {}
        held, held_folds, protocols[INSTANCE_HELD_OUT] = self._instance_held_out(plain, plain_name)
        protocols[plain_name] = plain_judged
        protocol = plain_name if held is None else INSTANCE_HELD_OUT
        head = plain if held is None else held
        head_folds = dealt if held_folds is None else held_folds

        majority_right, majority = self._majority(head, protocol)

        def beside(name: str, control: ControlFeatures | None, reason: str = "", default: str = "") -> Judged:
            """Judge other features by the same folds."""
            if control is None:
                return Judged(default, reason=reason or "these trials have no such features")
            try:
                found = self._pooled(name, control.table, head_folds)
            except FitRefused as refusal:
                return Judged(control.what, reason=str(refusal))
            right = found.right(self.labels)
            against = difference(head.right(self.labels), right)
            if name == "before_contact" and difference(right, majority_right).interval[0] > 0.0:
                self.warnings.append(
                    f"before any contact {self._rate(found).rate:.3f} are right already ({control.what}; the "
                    f"commonest label alone: {np.mean(majority_right):.3f}): the recording tells the labels apart"
                )
            return Judged(control.what, self._rate(found), difference=against, of=protocol)

        controls: dict[str, Judged] = {}
        if with_controls:
            controls = {
                "before_contact": beside(
                    "before_contact",
                    labelled.before_contact,
                    labelled.no_before_contact,
                    "features from before the contact only",
                ),
                "width_only": beside("width_only", labelled.width, labelled.no_width, "p_first alone"),
                INSTANCE_HELD_OUT: protocols[INSTANCE_HELD_OUT],
                "recording_order": self._in_order(plain, plain_name),
                "majority_class": majority,
                "shuffled_labels": self._shuffled(),
            }
            controls.update((name, beside(name, one)) for name, one in labelled.variants.items())
            self._warn_of_leaks(controls)
        return Evaluation(
            source=labelled.source,
            classifier=self.classifier,
            target=self.target,
            features=tuple(zip(table.names, table.units, strict=True)),
            protocol=protocol,
            headline=self._rate(head),
            confusion=confusion(self.labels, head.predicted),
            protocols=protocols,
            controls=controls,
            by_class=self._by_class(head),
            unlike=RecognitionRate(int(head.unlike.sum()), len(self.labels)),
            learning_curve=self._curve(head_folds, head) if with_curve else (),
            warnings=tuple(self.warnings),
            notes=tuple(self.notes),
            folds=self.k,
            seed=self.seed,
            settings=self.settings,
            confusions={
                name: confusion(self.labels, one.predicted)
                for name, one in ((INSTANCE_HELD_OUT, held), (plain_name, plain))
                if one is not None
            },
        )

    def _chosen(self, labelled: Labelled) -> Labelled:
        """Return the trials with the labels that are to be told apart."""
        if self.target == "class":
            labelled = labelled.aimed("class")
        elif self.target == "state":
            labelled.aimed("state")
            states: dict[str, set[str]] = {}
            for label in labelled.labels:
                states.setdefault(class_of(label), set()).add(label)
            single = sorted(name for name, of in states.items() if len(of) == 1)
            if single:
                self.notes.append(f"left out, as they have one state only: {', '.join(single)}")
                kept = [i for i, label in enumerate(labelled.labels) if class_of(label) not in single]
                if not kept:
                    raise ConfigError(
                        f"every class in {labelled.source} has one state: nothing to tell apart"
                    )
                labelled = labelled.rows(np.array(kept, dtype=np.int64))
        if len(labelled.classes) < 2:
            raise ConfigError(
                f"every trial of {labelled.source} has the label {labelled.labels[0]!r}: there is nothing to tell apart"
            )
        return labelled

    def _groups(self) -> Groups:
        if self.target != "state":
            return [np.arange(len(self.labels))]
        of = np.array([class_of(label) for label in self.labels])
        return [np.flatnonzero(of == name) for name in np.unique(of)]

    def _note_small_labels(self) -> None:
        counts = Counter(self.labels)
        alone = sorted(label for label, n in counts.items() if n == 1)
        few = sorted(label for label, n in counts.items() if 1 < n < self.k)
        if alone:
            self.notes.append(f"one trial only, so that no fold can get it right: {', '.join(alone)}")
        if few:
            self.notes.append(f"fewer trials than folds ({self.k}): {', '.join(few)}")

    def _folds(self, deal: Callable[[Sequence[str], Any], Folds]) -> list[Folds]:
        return [deal([self.labels[i] for i in rows], rows) for rows in self.groups]

    def _pooled(
        self,
        name: str,
        table: FeatureTable,
        folds: Sequence[Folds],
        share: float = 1.0,
        labels: Sequence[str] | None = None,
    ) -> Pooled:
        labels = self.labels if labels is None else labels
        total = sum(int(of.max()) + 1 for of in folds)
        done = 0

        def step() -> None:
            nonlocal done
            done += 1
            if self.progress is not None:
                self.progress(name, done, total)

        return cross_validate(
            self.learner, table, labels, self.groups, folds, seed=self.seed, share=share, progress=step
        )

    def _rate(self, pooled: Pooled) -> RecognitionRate:
        return RecognitionRate(sum(pooled.right(self.labels)), len(self.labels))

    def _instance_held_out(
        self, plain: Pooled, plain_name: str
    ) -> tuple[Pooled | None, list[Folds] | None, Judged]:
        what = f"at most {self.k} folds of whole instances: no model knew the very thing it is tested on"
        instances = self.labelled.instances
        if instances is None:
            reason = self.labelled.no_instances or "no instances are named"
            return None, None, Judged(what, reason=reason)
        alone = sorted(
            label
            for label in self.labelled.classes
            if len({one for one, of in zip(instances, self.labels, strict=True) if of == label}) == 1
        )
        if alone:
            reason = f"one instance only, which cannot be held out and known: {', '.join(alone)}"
            return None, None, Judged(what, reason=reason)
        folds = self._folds(
            lambda labels, rows: instance_held_out(labels, [instances[i] for i in rows], self.k, self.seed)
        )
        try:
            held = self._pooled(INSTANCE_HELD_OUT, self.labelled.table, folds)
        except FitRefused as refusal:
            return None, None, Judged(what, reason=str(refusal))
        against = difference(plain.right(self.labels), held.right(self.labels))
        return held, folds, Judged(what, self._rate(held), difference=against, of=plain_name)

    def _in_order(self, plain: Pooled, plain_name: str) -> Judged:
        what = f"{self.k} folds, each a block of every label's trials in the order of their recording"
        order = self.labelled.order
        if order is None:
            return Judged(what, reason=self.labelled.no_order or "the order of recording is not known")
        folds = self._folds(lambda labels, rows: in_order(labels, [order[i] for i in rows], self.k))
        try:
            blocks = self._pooled("recording_order", self.labelled.table, folds)
        except FitRefused as refusal:
            return Judged(what, reason=str(refusal))
        against = difference(plain.right(self.labels), blocks.right(self.labels))
        return Judged(what, self._rate(blocks), difference=against, of=plain_name)

    def _warn_of_leaks(self, controls: Mapping[str, Judged]) -> None:
        for name, why in (
            (INSTANCE_HELD_OUT, "part of the stratified rate is the very things' that were trained on"),
            ("recording_order", "part of the stratified rate is the moment's of the recording"),
        ):
            one = controls[name].difference
            if one is not None and one.interval[0] > 0.0:
                self.warnings.append(f"{name} is lower by {one.words}: {why}")

    def _majority(self, head: Pooled, protocol: str) -> tuple[list[bool], Judged]:
        right = np.zeros(len(self.labels), dtype=np.bool_)
        for rows in self.groups:
            most = commonest([self.labels[i] for i in rows])
            right[rows] = [self.labels[i] == most for i in rows]
        what = "the commonest label, whatever is felt"
        if len(self.groups) > 1:
            what += " (of each class, the commonest state)"
        against = difference(head.right(self.labels), right.tolist())
        judged = Judged(what, RecognitionRate(int(right.sum()), len(right)), difference=against, of=protocol)
        return right.tolist(), judged

    def _shuffled(self) -> Judged:
        """Judge by labels that say nothing: dealt anew to the trials, within each class where it is known."""
        rng = np.random.default_rng(self.seed)
        labels = np.array(self.labels)
        for rows in self.groups:
            labels[rows] = rng.permutation(labels[rows])
        shuffled = labels.tolist()
        folds = [stratified([shuffled[i] for i in rows], self.k, self.seed) for rows in self.groups]
        what = "the same trials with their labels shuffled, in stratified folds"
        try:
            found = self._pooled("shuffled_labels", self.labelled.table, folds, labels=shuffled)
        except FitRefused as refusal:
            return Judged(what, reason=str(refusal))
        return Judged(what, RecognitionRate(sum(found.right(shuffled)), len(shuffled)))

    def _by_class(self, head: Pooled) -> dict[str, RecognitionRate]:
        right: dict[str, list[bool]] = {}
        for label, one in zip(self.labels, head.right(self.labels), strict=True):
            right.setdefault(class_of(label), []).append(one)
        return {name: RecognitionRate(sum(of), len(of)) for name, of in sorted(right.items())}

    def _curve(self, folds: Sequence[Folds], head: Pooled) -> tuple[CurvePoint, ...]:
        points: list[CurvePoint] = []
        for share in SHARES:
            one = head
            if share < 1.0:
                try:
                    one = self._pooled(f"learning curve {share:.0%}", self.labelled.table, folds, share)
                except FitRefused as refusal:
                    self.notes.append(
                        f"the learning curve has no point at {share:.0%} of the trials: {refusal}"
                    )
                    continue
            # Of few trials of a label at least one is kept, so that small shares may come to the same trials.
            if not points or one.trained_on > points[-1].trained_on:
                points.append(CurvePoint(one.trained_on, self._rate(one)))
        return tuple(points)
