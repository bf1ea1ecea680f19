"""The task `compare`: classifiers on the same folds, and the effect of leaving out each feature."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from attrs import frozen

from graspsense.core.components.strict import structured
from graspsense.experiments.recognise import classifiers_of
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.experiments.trade.costs import CostSettings
from graspsense.experiments.trade.trade_task import (
    STRATIFIED,
    predictions,
    settings_of,
    simulated_result,
    stratified_folds,
    target_labels,
    trial_groups,
)
from graspsense.sources.simulated import simulated

WITHOUT: Final = "without "
"""Prefix of the name of a classifier that has all features except one."""


@frozen(kw_only=True)
class ComparisonSettings(CostSettings):
    """The keys of `[judge]`."""

    without: bool = True
    """Whether to evaluate the first classifier also without each of the features."""


def compare(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the rate of each classifier."""
    settings = structured(params["judge"], ComparisonSettings, "[judge]")
    data = simulated(settings_of(params), groups=trial_groups(params), seed=seed)
    classifiers = classifiers_of(params)
    tables = {name: (learner, data.table) for name, learner in classifiers.items()}
    if settings.without:
        classifier = next(iter(classifiers.values()))
        for feature in data.table.names:
            others = [name for name in data.table.names if name != feature]
            tables[f"{WITHOUT}{feature}"] = (classifier, data.table.columns(others))
    results = []
    for target in settings.targets:
        folds = stratified_folds(data.labels, target, seed)
        true = target_labels(data.labels, target)
        for name, (learner, table) in tables.items():
            predicted = predictions(learner, table, data.labels, target, folds, seed)
            results.append(
                ClassifierResult.from_answers(name, target, STRATIFIED, true, predicted, data, cost=0.0)
            )
    return simulated_result(data, results)
