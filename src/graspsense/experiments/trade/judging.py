"""What the tasks of this package share: trials, answers by cross validation, and how a rate is kept."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from graspsense.core.config import SelectedComponent, build, settings_from
from graspsense.core.labelled import Target, class_of
from graspsense.core.plugins import installed
from graspsense.evaluation.confusion import confusion
from graspsense.evaluation.crossval import cross_validate
from graspsense.evaluation.evaluate import rate_as_json
from graspsense.evaluation.folds import stratified
from graspsense.evaluation.intervals import RecognitionRate

if TYPE_CHECKING:
    from graspsense.core.config import Settings
    from graspsense.core.features import FeatureTable
    from graspsense.evaluation.folds import Folds

STRATIFIED = "stratified_10_fold"
FOLDS = 10


def settings_of(params: Mapping[str, Any]) -> Settings:
    """Return the settings of a task."""
    return settings_from(params["settings"], "the settings of the task")


def learners_of(params: Mapping[str, Any]) -> dict[str, SelectedComponent]:
    """Return the classifiers of a task by name."""
    found = {}
    for spec in params["learners"]:
        component = installed().find("classifier", spec["type"])
        found[str(spec["name"])] = SelectedComponent(component, build(component, spec["config"]))
    return found


def aimed(labels: Sequence[str], target: Target) -> list[str]:
    """Return what is told apart: the label as it is, or its class. States stay whole; classes keep them apart."""
    return [class_of(label) for label in labels] if target == "class" else list(labels)


def groups_of(labels: Sequence[str], target: Target) -> list[Any]:
    """Return which trials are judged apart from each other: for the state, those of one class."""
    if target != "state":
        return [np.arange(len(labels))]
    of = np.array([class_of(label) for label in labels])
    return [np.flatnonzero(of == name) for name in np.unique(of)]


def dealt(labels: Sequence[str], target: Target, seed: int) -> list[Folds]:
    """Return stratified folds for each group of trials."""
    told = aimed(labels, target)
    return [stratified([told[i] for i in rows], FOLDS, seed) for rows in groups_of(labels, target)]


def answers(
    learner: SelectedComponent,
    table: FeatureTable,
    labels: Sequence[str],
    target: Target,
    folds: Sequence[Folds],
    seed: int,
) -> tuple[str, ...]:
    """Return an answer for each trial, by a model of other folds."""
    told = aimed(labels, target)
    return cross_validate(learner, table, told, groups_of(labels, target), folds, seed=seed).predicted


def entry(
    learner: str,
    target: Target,
    true: Sequence[str],
    answered: Sequence[str],
    protocol: str,
    cost: float,
    **more: Any,
) -> dict[str, Any]:
    """Return a rate as a task keeps it, with what it costs."""
    matrix = confusion(true, answered)
    return {
        "learner": learner,
        "target": target,
        "protocol": protocol,
        **rate_as_json(RecognitionRate(matrix.correct, matrix.n)),
        "labels": list(matrix.labels),
        "confusion": [list(row) for row in matrix.counts],
        "controls": {},
        "warnings": [],
        "notes": [],
        "tree": None,
        "cost": cost,
        **more,
    }
