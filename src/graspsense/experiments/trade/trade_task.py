"""What the trade-off tasks share: their settings, and cross-validated predictions of simulated trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from graspsense.core.components.strict import structured
from graspsense.core.learn.labelled import Target, class_of
from graspsense.core.settings.resolved import settings_from
from graspsense.core.settings.selected import SelectedComponent
from graspsense.evaluation.crossval import cross_validate
from graspsense.evaluation.folds import stratified, trials_by_class
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.sources.trial_source import TrialSource, groups_of

if TYPE_CHECKING:
    from graspsense.core.learn.labelled import Labelled
    from graspsense.core.settings.resolved import Settings
    from graspsense.core.values.features import FeatureTable
    from graspsense.evaluation.folds import Folds
    from graspsense.sources.simulated import Group

STRATIFIED: Final = "stratified_10_fold"
FOLDS: Final = 10


def settings_of(params: Mapping[str, Any]) -> Settings:
    """Return the settings of a task."""
    return settings_from(params["settings"], "the settings of the task")


def trial_groups(params: Mapping[str, Any]) -> tuple[Group, ...]:
    """Return the groups of simulated trials of a task."""
    return groups_of(structured(params["data"], TrialSource, "[data]"))


def target_labels(labels: Sequence[str], target: Target) -> list[str]:
    """Return the labels to recognise: whole labels, or classes. States stay whole: folds separate the classes."""
    return [class_of(label) for label in labels] if target == "class" else list(labels)


def stratified_folds(labels: Sequence[str], target: Target, seed: int) -> list[Folds]:
    """Return stratified folds for each group of `trials_by_class`."""
    true = target_labels(labels, target)
    return [stratified([true[i] for i in rows], FOLDS, seed) for rows in trials_by_class(labels, target)]


def predictions(
    learner: SelectedComponent,
    table: FeatureTable,
    labels: Sequence[str],
    target: Target,
    folds: Sequence[Folds],
    seed: int,
) -> tuple[str, ...]:
    """Return a prediction for each trial, from a model that was trained on the other folds."""
    true = target_labels(labels, target)
    groups = trials_by_class(labels, target)
    return cross_validate(learner, table, true, groups, folds, seed=seed).predicted


def simulated_result(data: Labelled, classifiers: Sequence[ClassifierResult]) -> RecognitionResult:
    """Return the result of a task on simulated trials."""
    return RecognitionResult(
        source=data.source, simulated=True, notes=data.notes, classifiers=tuple(classifiers)
    )
