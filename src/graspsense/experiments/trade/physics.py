"""The task `physics`: learned on grasps of a model that is wrong by so much, judged on grasps of the model itself."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import field, frozen
from attrs.validators import ge

from graspsense.core.config import settings_from
from graspsense.core.errors import ConfigError
from graspsense.core.strict import structured
from graspsense.experiments.recognise import TEST_SEED_OFFSET
from graspsense.experiments.trade.costs import CostOnly
from graspsense.experiments.trade.judging import aimed, entry, learners_of, settings_of
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import Source, groups_of


@frozen(kw_only=True)
class Physics(CostOnly):
    """The keys of `[judge]`."""

    error: float = field(default=0.0, validator=ge(-0.9))
    """By this share the keys of the gripper named in `of` are too large where it is learned."""
    of: tuple[str, ...] = ("coulomb_n", "breakaway_n", "load_share", "rotor_kg_m2", "skin_n_m")
    learned_on: Mapping[str, Any] = field(factory=dict)
    """Further keys of the gripper where it is learned, as `accuracy`."""


PROTOCOL = "learned_on_another_model"


def physics(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return how often a classifier is right on the model that learned on the wrong one. Raises ConfigError."""
    judge = structured(params["judge"], Physics, "[judge]")
    wrong = {table: dict(keys) for table, keys in params["settings"].items()}
    for key in judge.of:
        try:
            wrong["gripper"][key] *= 1.0 + judge.error
        except (KeyError, TypeError):
            raise ConfigError(f"judge.of: {key!r} is no number among the gripper's settings") from None
    wrong["gripper"].update(judge.learned_on)
    groups = groups_of(structured(params["data"], Source, "[data]"))
    known = simulated(settings_from(wrong, "the wrong model"), groups=groups, seed=seed)
    asked = simulated(settings_of(params), groups=groups, seed=seed + TEST_SEED_OFFSET)
    cost = float(judge.learned_on.get("accuracy", judge.error))
    judged = []
    for name, learner in learners_of(params).items():
        for target in judge.targets:
            true: list[str] = []
            given: list[str] = []
            for kind in (
                sorted({label.partition(":")[0] for label in known.labels}) if target == "state" else [""]
            ):
                one, other = (data.of_class(kind) if kind else data for data in (known, asked))
                classifier = learner.create()
                classifier.fit(one.table, aimed(one.labels, target), seed)
                classes = classifier.classes()
                true += aimed(other.labels, target)
                given += [classes[k] for k in classifier.probabilities(other.table).argmax(axis=1)]
            judged.append(entry(name, target, true, given, PROTOCOL, cost, x=cost))
    return {"source": asked.source, "simulated": True, "notes": list(asked.notes), "judged": judged}
