"""The task `early`: recognition from the first part of a grasp, up to some time after contact."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import numpy as np
from attrs import field, frozen
from attrs.validators import max_len

from graspsense.core.components.strict import structured
from graspsense.core.learn.checkpoints import contact_of
from graspsense.core.settings.resolved import settings_from
from graspsense.core.values.features import Features, table_of
from graspsense.core.values.signals import Phase
from graspsense.core.values.trace import Trace
from graspsense.evaluation.crossval import cross_validate
from graspsense.evaluation.folds import stratified, trials_by_class
from graspsense.experiments.recognise import classifiers_of
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.experiments.trade.costs import (
    FOLDS,
    CostSettings,
    simulated_result,
    simulated_trials,
    target_labels,
)

STRATIFIED: Final = f"stratified_{FOLDS}_fold"
MOST_MOMENTS: Final = 100
"""Limit on the moments at which a grasp is recognised."""


@frozen(kw_only=True)
class EarlySettings(CostSettings):
    """The keys of `[judge]`."""

    moments_s: tuple[float, ...] = field(
        default=(0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.8, 1.2), validator=max_len(MOST_MOMENTS)
    )
    """Seconds after the contact of both pads at which a prediction is made."""


def early(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the rate at each moment, trained and tested on the trace up to it.

    Of the features of the paper, all but `p_first` are missing before rest. The cost is the mean time from contact to
    the moment, or to rest if that comes first.
    """
    early_settings = structured(params["judge"], EarlySettings, "[judge]")
    moments = early_settings.moments_s
    feature_set = settings_from(params["settings"], "the settings of the task").features.create()
    rows: dict[float, list[Features]] = {moment: [] for moment in moments}
    used_s: dict[float, list[float]] = {moment: [] for moment in moments}

    def cut(number: int, label: str, trace: Trace) -> None:
        del number, label
        touched = contact_of(trace)
        ended = np.flatnonzero(trace.phase >= int(Phase.HOLD))
        end = float(trace.t_s[ended[0]]) if len(ended) else float(trace.t_s[-1])
        contact = end if touched is None else touched
        for moment in moments:
            rows[moment].append(feature_set.extract(trace.until(contact + moment)))
            used_s[moment].append(min(moment, end - contact))

    data = simulated_trials(params, seed, cut)
    results = []
    for name, learner in classifiers_of(params).items():
        suffix = f", {name}" if len(params["learners"]) > 1 else ""
        for target in early_settings.targets:
            true = target_labels(data.labels, target)
            folds = np.empty(len(true), dtype=np.int64)
            within = folds.copy()
            for number, of_class in enumerate(trials_by_class(data.labels, target)):
                folds[of_class] = FOLDS * number + stratified([true[i] for i in of_class], FOLDS, seed)
                within[of_class] = number
            for moment, features in rows.items():
                table = table_of(features)
                predicted = cross_validate(learner, table, true, folds, within, seed=seed).predicted
                cost = float(np.mean(used_s[moment]))
                results.append(
                    ClassifierResult.from_answers(
                        f"{moment:g} s{suffix}", target, STRATIFIED, true, predicted, data, FOLDS, cost=cost
                    )
                )
    return simulated_result(data, results)
