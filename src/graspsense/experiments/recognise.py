"""The task `recognise`: make or read trials, and measure the rates of classifiers on the same folds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Final, Literal

from attrs import field, frozen
from attrs.validators import ge, le, min_len

from graspsense.core.components.registry import installed
from graspsense.core.components.strict import structured
from graspsense.core.learn.copies import apart_from, without_copies
from graspsense.core.learn.labelled import Labelled, Target, class_of
from graspsense.core.settings.resolved import Settings, settings_from
from graspsense.core.settings.selected import SelectedComponent, build
from graspsense.core.values.errors import ConfigError, counted, listed
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.reasons import TreeNode
from graspsense.core.values.trace import Trace
from graspsense.evaluation.evaluate import evaluate
from graspsense.evaluation.folds import trials_by_class
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.results import Evaluation
from graspsense.experiments.task_results import (
    MOST_KEPT_GRASPS,
    ClassifierResult,
    RecognitionResult,
    TrialValues,
)
from graspsense.report.grasp_curve import GraspCurve, grasp_curve
from graspsense.sources.trial_source import TrialSource, labelled_trials

OTHER_TRIALS: Final = "other_trials"
"""The protocol that trains on one source and tests on another."""
TEST_SEED_OFFSET: Final = 500_000
"""Added to the seed for the trials of `[test]`, so that they are of other objects."""


@frozen(kw_only=True)
class EvaluationSettings:
    """The keys of `[judge]`."""

    folds: int = field(default=10, validator=ge(2))
    targets: tuple[Literal["both", "class", "state"], ...] = field(default=("both",), validator=min_len(1))
    """What is recognised: the label as it is, its class, or the state within each class. See `evaluate`."""
    protocol: Literal["headline", "stratified", "instance_held_out"] = "headline"
    """The folds of the reported rate. `headline` holds out whole instances if instances are named."""
    controls: bool = True
    """Whether to measure the controls."""
    learning_curve: bool = False
    grasps: int = field(default=3, validator=[ge(0), le(MOST_KEPT_GRASPS)])
    """Simulated grasps of each label that are kept for the page, from the first seed."""
    of_folds: ClassVar = ("folds", "protocol", "controls", "learning_curve")
    """Keys without an effect where other trials are tested on."""


def recognise(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return trials and rates.

    `params` holds `settings` (resolved tables), `data` and `test` (keys of `TrialSource`; `test` may be None),
    `learners` (name, type and config of each classifier), `judge` (keys of `EvaluationSettings`) and `first` (whether
    to keep grasps and trees).
    """
    evaluation = structured(params["judge"], EvaluationSettings, "[judge]")
    settings = settings_from(params["settings"], "the settings of the task")
    curves: list[GraspCurve] = []
    counts: Counter[str] = Counter()

    def keep(number: int, label: str, trace: Trace) -> None:
        """Keep the curves of the first few grasps of each label."""
        counts[label] += 1
        if counts[label] <= evaluation.grasps:
            curves.append(grasp_curve(trace, label, number))

    data = _trials(params["data"], settings, seed, keep if params["first"] and evaluation.grasps else None)
    test = None
    if params["test"]:
        test = apart_from(_trials(params["test"], settings, seed + TEST_SEED_OFFSET, None), data)
    results = []
    for name, learner in classifiers_of(params).items():
        for target in evaluation.targets:
            tree = _tree(learner, data, target, seed) if params["first"] else None
            if test is not None:
                result = _on_other_trials(name, learner, data, test, target, seed, tree)
            else:
                result = _cross_validated(name, learner, data, target, seed, evaluation, tree)
            results.append(result)
    return RecognitionResult(
        source=data.source,
        simulated=bool(data.provenance.get("simulated", False)),
        notes=data.notes,
        provenance=data.provenance,
        trials=TrialValues.from_trials(data),
        classifiers=tuple(results),
        grasps=tuple(curves),
    )


def classifiers_of(params: Mapping[str, Any]) -> dict[str, SelectedComponent]:
    """Return the classifiers of a task by name."""
    classifiers = {}
    for spec in params["learners"]:
        component = installed().find("classifier", spec["type"])
        classifiers[str(spec["name"])] = SelectedComponent(component, build(component, spec["config"]))
    return classifiers


def _trials(
    values: Mapping[str, Any],
    settings: Settings,
    seed: int,
    on_trace: Callable[[int, str, Trace], None] | None,
) -> Labelled:
    return without_copies(
        labelled_trials(
            structured(values, TrialSource, "[data]"),
            settings=lambda: settings,
            features=settings.features.create,
            seed=seed,
            on_trace=on_trace,
        )
    )


def _cross_validated(
    name: str,
    learner: SelectedComponent,
    data: Labelled,
    target: Target,
    seed: int,
    settings: EvaluationSettings,
    tree: tuple[TreeNode, ...] | None,
) -> ClassifierResult:
    """Return the rate of a classifier under the protocol that the settings ask for."""
    evaluation = evaluate(
        learner,
        data,
        classifier=f"{learner.component.qualified} {learner.component.version}",
        target=target,
        folds=settings.folds,
        seed=seed,
        controls=settings.controls,
        learning_curve=settings.learning_curve,
        permutations=1,  # one for each seed
    )
    protocol = _protocol(evaluation, settings.protocol)
    rate = evaluation.headline
    if protocol != evaluation.protocol:
        measured = evaluation.protocols[protocol]
        if measured.rate is None:
            raise ConfigError(
                f"judge.protocol = {settings.protocol!r} cannot be followed here: {measured.reason}"
            )
        rate = measured.rate
    return ClassifierResult(
        classifier=name,
        target=target,
        protocol=protocol,
        rate=rate,
        confusion=evaluation.confusions[protocol],
        controls=evaluation.controls,
        warnings=evaluation.warnings,
        notes=evaluation.notes,
        tree=tree,
    )


def _protocol(evaluation: Evaluation, wanted: str) -> str:
    """Return the full name of the protocol that the settings ask for. Raises ConfigError if it was not measured."""
    if wanted == "headline":
        return evaluation.protocol
    for name in evaluation.protocols:
        if name.startswith(wanted):
            return name
    raise ConfigError(
        f"judge.protocol = {wanted!r} cannot be followed here: no instances are named, and trials were grouped by "
        "their values"
    )


def _on_other_trials(
    name: str,
    learner: SelectedComponent,
    data: Labelled,
    test: Labelled,
    target: Target,
    seed: int,
    tree: tuple[TreeNode, ...] | None,
) -> ClassifierResult:
    told: list[str] = []
    with gathered_warnings(told):
        true, predicted = true_and_predicted(learner, data, test, target, seed)
    note = (
        f"trained on {counted(len(data), 'trial')} of {data.source}, tested on {len(true)} of {test.source}"
    )
    notes = (note, *_note_same_objects(data, test), *test.notes, *told)
    return ClassifierResult.from_answers(
        name, target, OTHER_TRIALS, true, predicted, test, notes=notes, tree=tree
    )


def _note_same_objects(data: Labelled, test: Labelled) -> list[str]:
    """Return a note if recorded trials to test on are of objects that are learned from."""
    if data.instances is None or test.instances is None or data.provenance.get("simulated"):
        return []
    tested = set(test.instances)
    same = sorted(tested & set(data.instances))
    if not same:
        return []
    return [
        f"{len(same)} of {counted(len(tested), 'instance')} to test on are learned from too, so that the rate is not "
        f"that of other objects: {listed(same)}"
    ]


def true_and_predicted(
    learner: SelectedComponent, training: Labelled, test: Labelled, target: Target, seed: int
) -> tuple[list[str], list[str]]:
    """Return the labels of other trials, true and predicted, with a model for each class if the target is `state`."""
    if target == "class":
        training, test = training.aimed("class"), test.aimed("class")
    predicted = [""] * len(test)
    for rows in trials_by_class(test.labels, target):
        known = training.of_class(class_of(test.labels[int(rows[0])])) if target == "state" else training
        answers = predictions(learner, known.table, known.labels, test.table.rows(rows), seed)
        for i, answer in zip(rows.tolist(), answers, strict=True):
            predicted[i] = answer
    return list(test.labels), predicted


def predictions(
    learner: SelectedComponent, known: FeatureTable, labels: Sequence[str], tested: FeatureTable, seed: int
) -> list[str]:
    """Return what a classifier that learns known trials predicts for others."""
    classifier = learner.create()
    classifier.fit(known, labels, seed)
    classes = classifier.classes()
    return [classes[k] for k in classifier.probabilities(tested).argmax(axis=1)]


def _tree(
    learner: SelectedComponent, data: Labelled, target: Target, seed: int
) -> tuple[TreeNode, ...] | None:
    """Return the tree that the classifier grows on all trials; None if it grows none, or one per class."""
    if target == "state" and len({class_of(label) for label in data.labels}) > 1:
        return None
    labelled = data.aimed(target)
    classifier = learner.create()
    with gathered_warnings([]):  # the evaluation tells them
        classifier.fit(labelled.table, labelled.labels, seed)
    nodes = classifier.tree()
    return None if nodes is None else tuple(nodes)
