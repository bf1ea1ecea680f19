"""The task `squeezes`: the same thing squeezed several times, each time placed anew, and the answers put together."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from attrs import field, frozen
from attrs.validators import ge

from graspsense.core.errors import ConfigError
from graspsense.core.strict import structured
from graspsense.evaluation.evaluate import INSTANCE_HELD_OUT
from graspsense.evaluation.folds import instance_held_out
from graspsense.experiments.trade.costs import CostOnly, seconds
from graspsense.experiments.trade.judging import FOLDS, aimed, entry, groups_of, learners_of, settings_of
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import Source
from graspsense.sources.trial_source import groups_of as groups_of_source

LEAST = 1e-3
"""A label that a tree gives no trial may still be the right one."""


@frozen(kw_only=True)
class Squeezes(CostOnly):
    """The keys of `[judge]`. `[data]` gives each thing `most` trials: its squeezes."""

    most: int = field(default=4, validator=ge(1))


def squeezes(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the rate after one, two ... squeezes, the probabilities of all of them multiplied.

    No model knew the thing that it is asked about. Each squeeze costs a whole approach.
    """
    judge = structured(params["judge"], Squeezes, "[judge]")
    settings = settings_of(params)
    source = structured(params["data"], Source, "[data]")
    data = simulated(settings, groups=groups_of_source(source), seed=seed)
    n = judge.most
    if len(data) % n:
        raise ConfigError(
            f"{len(data)} trials are no multiple of judge.most = {n} squeezes: set data.trials to it"
        )
    result = {
        "features": list(zip(data.table.names, data.table.units, strict=True)),
        "values": [[None if np.isnan(v) else v for v in row] for row in data.table.values.tolist()],
    }
    one_s = seconds(params["settings"], result)
    judged = []
    things = data.instances or ()
    for name, learner in learners_of(params).items():
        for target in judge.targets:
            told = np.array(aimed(data.labels, target))
            chosen: dict[int, list[str]] = {k: [] for k in range(1, n + 1)}
            true: list[str] = []
            for rows in groups_of(data.labels, target):
                labels = [str(one) for one in told[rows]]
                folds = instance_held_out(labels, [things[i] for i in rows], FOLDS, seed)
                for fold in range(int(folds.max()) + 1):
                    test, training = rows[folds == fold], rows[folds != fold]
                    classifier = learner.create()
                    classifier.fit(data.table.rows(training), [str(one) for one in told[training]], seed)
                    shares = np.log(np.maximum(classifier.probabilities(data.table.rows(test)), LEAST))
                    # The squeezes of one thing in one state follow each other.
                    of_thing = shares.reshape(len(test) // n, n, -1).cumsum(axis=1)
                    classes = classifier.classes()
                    true += [str(one) for one in told[test[::n]]]
                    for k in chosen:
                        chosen[k] += [classes[best] for best in of_thing[:, k - 1].argmax(axis=1)]
            for k, given in chosen.items():
                called = f"{k} squeeze{'s' if k > 1 else ''}" + (
                    f", {name}" if len(params["learners"]) > 1 else ""
                )
                judged.append(entry(called, target, true, given, INSTANCE_HELD_OUT, k * one_s, x=k))
    return {"source": data.source, "simulated": True, "notes": list(data.notes), "judged": judged}
