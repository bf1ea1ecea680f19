"""Evaluating a classifier on labelled trials: its rate, with protocols, controls and a learning curve.

`docs/evaluation.md` defines every number.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from graspsense.core.learn.confounding import confounded
from graspsense.core.learn.labelled import TARGETS, Labelled, Target, class_of
from graspsense.core.settings.selected import select_component
from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.label_text import alike_words, natural_order, spelled_alike
from graspsense.evaluation.controls import PERMUTATIONS, ControlMeasurements
from graspsense.evaluation.crossval import ClassifierFactory
from graspsense.evaluation.evaluator import Evaluator, Progress
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.intervals import MIN_INSTANCES
from graspsense.evaluation.results import Evaluation, confusion


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
    notes = list(labelled.notes)
    trials = _trials_for(labelled, target, notes)
    notes += notes_on(trials, folds)
    evaluator = Evaluator(learner, trials, target, folds, seed, progress, notes)
    with gathered_warnings(notes):
        headline, protocols = evaluator.measure_protocols()
        measuring = ControlMeasurements(evaluator, headline)
        measured = measuring.measure(protocols, permutations) if controls else {}
        curve = evaluator.learning_curve(headline) if learning_curve else ()
    labels, table, held_out = trials.labels, trials.table, evaluator.held_out(headline)
    return Evaluation(
        source=labelled.source,
        classifier=classifier or _name_of(learner),
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
        warnings=tuple(measuring.warnings),
        notes=tuple(notes),
        confusions={
            name: confusion(labels, pooled.predicted) for name, pooled in evaluator.pooled_by_protocol.items()
        },
        sets=held_out.set_coverage(evaluator.rate_among),
        reliability=held_out.reliability(evaluator.rate_among),
    )


def _name_of(learner: ClassifierFactory) -> str:
    """Return the name and version of a component, or the class of what makes classifiers."""
    component = getattr(learner, "component", None)
    return f"{component.qualified} {component.version}" if component else type(learner).__name__


def _check_arguments(labelled: object, target: str) -> None:
    if not isinstance(labelled, Labelled):
        raise ConfigError(
            f"evaluate: expected a classifier, then trials, found {labelled!r:.100} as the trials: "
            "write evaluate('c45', load_trials('simulated'))"
        )
    if target not in TARGETS:
        raise ConfigError(f"target: expected {', '.join(map(repr, TARGETS))}, found {target!r}")


def _trials_for(labelled: Labelled, target: Target, notes: list[str]) -> Labelled:
    """Return the trials with the labels that the target asks for.

    Raises ConfigError if there are not at least two labels, or if a target `state` finds labels without a state.
    """
    if target == "class":
        labelled = labelled.aimed("class")
    elif target == "state":
        labelled = _with_several_states(labelled, notes)
    labelled.refuse_one_label()
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


def notes_on(trials: Labelled, k: int) -> Iterator[str]:
    """Yield what a reader must know of these trials, which are evaluated in `k` folds."""
    yield from _on_small_labels(trials, k)
    yield from _on_instances(trials)
    if why := confounded(trials):
        yield why


def _on_small_labels(trials: Labelled, k: int) -> Iterator[str]:
    counts = Counter(trials.labels)
    single = natural_order(label for label, n in counts.items() if n == 1)
    few = natural_order(label for label, n in counts.items() if 1 < n < k)
    if single:
        yield f"labels with a single trial, which no fold can predict: {', '.join(single)}"
    if few:
        yield f"labels with fewer trials than folds ({k}): {', '.join(few)}"


def _on_instances(trials: Labelled) -> Iterator[str]:
    """Note what makes the instances of these trials less than other objects."""
    if trials.instances is None:
        return
    count = len(set(trials.instances))
    if count < MIN_INSTANCES:
        yield (
            f"{counted(count, 'instance')}: with fewer than {MIN_INSTANCES}, a set of trials gives "
            "no interval, and its controls give no warning"
        )
    if count == len(trials.labels) and not trials.provenance.get("simulated"):
        yield (
            "each trial has an instance of its own: if these are numbers of trials, grasps of the same object are "
            "in training and test, and the rate is not that of other objects"
        )
    if pairs := spelled_alike(trials.instances):
        yield (
            f"instances that differ in spelling only count as two: {alike_words(pairs)}. If they are one object, its "
            "grasps are in training and test"
        )
