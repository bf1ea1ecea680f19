"""The task `squeezes`: the same object squeezed several times, each time placed anew, with combined predictions."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from attrs import field, frozen
from attrs.validators import ge, le
from numpy.typing import NDArray

from graspsense.core.components.strict import structured
from graspsense.core.learn.labelled import Labelled, Target
from graspsense.core.settings.selected import SelectedComponent
from graspsense.core.values.errors import ConfigError, counted
from graspsense.evaluation.folds import INSTANCE_HELD_OUT, instance_held_out, trials_by_class
from graspsense.experiments.recognise import classifiers_of
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult, TrialValues
from graspsense.experiments.trade.costs import (
    FOLDS,
    CostSettings,
    mean_seconds,
    simulated_result,
    simulated_trials,
    target_labels,
)

MIN_PROBABILITY: Final = 1e-3
"""Lower bound on a probability: a label that a tree gives no trial may still be correct."""


MOST_SQUEEZES: Final = 100
"""Limit on the squeezes of one object."""


@frozen(kw_only=True)
class RepeatSettings(CostSettings):
    """The keys of `[judge]`. `[data]` must give each object `most` trials, its squeezes."""

    most: int = field(default=4, validator=[ge(1), le(MOST_SQUEEZES)])
    """Largest number of squeezes."""


def squeezes(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the rates after one, two, ... squeezes, with the product of their probabilities.

    No model was trained on the object that it is tested on. Each squeeze costs a complete approach. Raises ConfigError
    if the number of trials is not a multiple of the number of squeezes.
    """
    settings = structured(params["judge"], RepeatSettings, "[judge]")
    data = simulated_trials(params, seed)
    if len(data) % settings.most:
        raise ConfigError(
            f"{len(data)} trials are not a multiple of judge.most = {settings.most} squeezes: set data.trials to it"
        )
    one_s = mean_seconds(params["settings"], TrialValues.from_trials(data))
    results = []
    for name, learner in classifiers_of(params).items():
        suffix = f", {name}" if len(params["learners"]) > 1 else ""
        for target in settings.targets:
            squeezed, predicted = _combined_predictions(learner, data, target, settings.most, seed)
            objects = data.rows(squeezed)
            true = target_labels(objects.labels, target)
            for k, labels in predicted.items():
                title = f"{counted(k, 'squeeze')}{suffix}"
                results.append(
                    ClassifierResult.from_answers(
                        title, target, INSTANCE_HELD_OUT, true, labels, objects, FOLDS, cost=k * one_s
                    )
                )
    return simulated_result(data, results)


def _combined_predictions(
    learner: SelectedComponent, data: Labelled, target: Target, n: int, seed: int
) -> tuple[NDArray[np.int64], dict[int, list[str]]]:
    """Return the first trial of each object in a state, and for 1 to `n` squeezes the predicted labels."""
    instances = data.instances or ()
    all_labels = np.array(target_labels(data.labels, target))
    predicted: dict[int, list[str]] = {k: [] for k in range(1, n + 1)}
    squeezed: list[NDArray[np.int64]] = []
    for rows in trials_by_class(data.labels, target):
        labels = [str(label) for label in all_labels[rows]]
        folds = instance_held_out(labels, [instances[i] for i in rows], FOLDS, seed)
        for fold in range(int(folds.max()) + 1):
            test, training = rows[folds == fold], rows[folds != fold]
            classifier = learner.create()
            classifier.fit(data.table.rows(training), [str(label) for label in all_labels[training]], seed)
            probabilities = classifier.probabilities(data.table.rows(test))
            # The squeezes of one object in one state are consecutive trials.
            logs = np.log(np.maximum(probabilities, MIN_PROBABILITY)).reshape(len(test) // n, n, -1)
            sums = logs.cumsum(axis=1)
            classes = classifier.classes()
            squeezed.append(test[::n])
            for k in predicted:
                predicted[k] += [classes[best] for best in sums[:, k - 1].argmax(axis=1)]
    return np.concatenate(squeezed), predicted
