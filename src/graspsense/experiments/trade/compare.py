"""The task `compare`: classifiers on the same folds, trial by trial; and each feature's worth, by leaving it out."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import frozen

from graspsense.core.strict import structured
from graspsense.experiments.trade.costs import CostOnly
from graspsense.experiments.trade.judging import (
    STRATIFIED,
    aimed,
    answers,
    dealt,
    entry,
    learners_of,
    settings_of,
)
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import Source, groups_of


@frozen(kw_only=True)
class Comparing(CostOnly):
    """The keys of `[judge]`."""

    without: bool = True
    """Whether the first classifier is judged without each of the features, too."""


WITHOUT = "without "


def compare(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the rate of each classifier, with which trials it got right (`right`) and the fold of each (`fold`)."""
    judge = structured(params["judge"], Comparing, "[judge]")
    data = simulated(
        settings_of(params), groups=groups_of(structured(params["data"], Source, "[data]")), seed=seed
    )
    learners = learners_of(params)
    tables = {name: (learner, data.table) for name, learner in learners.items()}
    if judge.without:
        first = next(iter(learners.values()))
        for feature in data.table.names:
            others = [one for one in data.table.names if one != feature]
            tables[f"{WITHOUT}{feature}"] = (first, data.table.columns(others))
    judged = []
    for target in judge.targets:
        folds = dealt(data.labels, target, seed)
        told = aimed(data.labels, target)
        fold = np.concatenate(folds).tolist() if len(folds) == 1 else None
        for name, (learner, table) in tables.items():
            given = answers(learner, table, data.labels, target, folds, seed)
            right = [int(one == other) for one, other in zip(told, given, strict=True)]
            judged.append(entry(name, target, told, given, STRATIFIED, 0.0, right=right, fold=fold))
    return {"source": data.source, "simulated": True, "notes": list(data.notes), "judged": judged}
