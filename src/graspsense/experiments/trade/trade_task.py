"""What the trade-off tasks share: their settings, labels, and results of simulated trials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

from graspsense.core.components.strict import structured
from graspsense.core.learn.labelled import Labelled, Target, class_of
from graspsense.core.settings.resolved import Settings, settings_from
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.sources.simulated import Group
from graspsense.sources.trial_source import TrialSource, groups_of

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


def simulated_result(data: Labelled, classifiers: Sequence[ClassifierResult]) -> RecognitionResult:
    """Return the result of a task on simulated trials."""
    return RecognitionResult(
        source=data.source, simulated=True, notes=data.notes, classifiers=tuple(classifiers)
    )
