"""The task `recognise`: make or read trials, draw features, and judge classifiers on the same folds."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

from attrs import field, frozen
from attrs.validators import ge

from graspsense.core.config import SelectedComponent, build, settings_from
from graspsense.core.errors import ConfigError
from graspsense.core.labelled import class_of
from graspsense.core.plugins import installed
from graspsense.core.strict import structured
from graspsense.evaluation.confusion import confusion
from graspsense.evaluation.evaluate import Evaluation, evaluate, rate_as_json
from graspsense.evaluation.intervals import RecognitionRate
from graspsense.report.grasps import grasp_as_json
from graspsense.sources.trial_source import Source, labelled_trials

if TYPE_CHECKING:
    from graspsense.core.labelled import Labelled, Target
    from graspsense.core.trace import Trace

OTHER_TRIALS = "other_trials"
"""The protocol where one source is learned from and another one judged on."""


@frozen(kw_only=True)
class Judging:
    """The keys of `[judge]`."""

    folds: int = field(default=10, validator=ge(2))
    targets: tuple[Literal["both", "class", "state"], ...] = ("both",)
    """What is recognised: the label as it is, its class, or the state within each class. See `evaluate`."""
    protocol: Literal["headline", "stratified", "instance_held_out"] = "headline"
    """Which folds the answer is about; `headline`: whole instances held out wherever they are named."""
    controls: bool = True
    """Whether the controls are measured, too."""
    learning_curve: bool = False
    grasps: int = field(default=3, validator=ge(0))
    """Simulated grasps of each label that are kept for the page, of the first seed."""


def recognise(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return trials and rates as JSON values.

    `params` holds `settings` (resolved tables), `data` and `test` (keys of `Source`; `test` may be None),
    `learners` (name, type, config), `judge` (keys of `Judging`) and `first` (whether grasps and trees are kept).
    """
    judge = structured(params["judge"], Judging, "[judge]")
    settings = settings_from(params["settings"], "the settings of the task")
    kept: list[dict[str, Any]] = []
    count: Counter[str] = Counter()

    def keep(number: int, label: str, trace: Trace) -> None:
        count[label] += 1
        if count[label] <= judge.grasps:
            kept.append({"label": label, "trial": number, **grasp_as_json(trace)})

    def trials(values: Mapping[str, Any], offset: int) -> Labelled:
        return labelled_trials(
            structured(values, Source, "[data]"),
            settings=lambda: settings,
            features=settings.features.create,
            seed=seed + offset,
            on_trace=keep if offset == 0 and params["first"] and judge.grasps else None,
        )

    data = trials(params["data"], 0)
    # Other things than those that are learned from, where they are simulated: seeds count things apart.
    test = trials(params["test"], TEST_SEED_OFFSET) if params["test"] else None
    judged: list[dict[str, Any]] = []
    for spec in params["learners"]:
        component = installed().find("classifier", spec["type"])
        learner = SelectedComponent(component, build(component, spec["config"]))
        for target in judge.targets:
            if test is not None:
                found = _on_other_trials(learner, data, test, target, seed)
            else:
                found = _found(
                    evaluate(
                        learner,
                        data,
                        classifier=f"{component.qualified} {component.version}",
                        target=target,
                        folds=judge.folds,
                        seed=seed,
                        controls=judge.controls,
                        learning_curve=judge.learning_curve,
                    ),
                    judge.protocol,
                )
            tree = _tree(learner, data, target, seed) if params["first"] else None
            judged.append({"learner": spec["name"], "target": target, **found, "tree": tree})
    return {**_table(data), "judged": judged, "grasps": kept}


TEST_SEED_OFFSET = 500_000
"""Added to the seed for the trials of `[test]`, so that they are of other things."""


def _table(data: Labelled) -> dict[str, Any]:
    return {
        "source": data.source,
        "simulated": bool(data.provenance.get("simulated", False)),
        "notes": list(data.notes),
        "provenance": dict(data.provenance),
        "features": [list(pair) for pair in zip(data.table.names, data.table.units, strict=True)],
        "labels": list(data.labels),
        "instances": None if data.instances is None else list(data.instances),
        "values": [[None if math.isnan(v) else v for v in row] for row in data.table.values.tolist()],
    }


def _found(found: Evaluation, protocol: str) -> dict[str, Any]:
    """Return an evaluation as JSON, its rate that of the protocol which was asked for."""
    values = found.as_json()
    for drop in ("source", "features", "units", "seed", "folds", "settings"):
        del values[drop]
    if protocol != "headline":
        name = next(one for one in found.protocols if one.startswith(protocol))
        one = found.protocols[name]
        if one.rate is None:
            raise ConfigError(f"judge.protocol = {protocol!r} cannot be followed here: {one.reason}")
        values.update(protocol=name, **rate_as_json(one.rate))
        matrix = found.confusions[name]
        values.update(labels=list(matrix.labels), confusion=[list(row) for row in matrix.counts])
    return values


def _on_other_trials(
    learner: SelectedComponent, data: Labelled, test: Labelled, target: Target, seed: int
) -> dict[str, Any]:
    """Train on one source and judge on the other, each class apart where its states are told."""
    groups = {""} if target != "state" else {one.partition(":")[0] for one in test.labels}
    true: list[str] = []
    answers: list[str] = []
    for name in sorted(groups):
        known, asked = (one.of_class(name) if name else one for one in (data, test))
        if target == "class":
            known, asked = known.aimed("class"), asked.aimed("class")
        classifier = learner.create()
        classifier.fit(known.table, known.labels, seed)
        classes = classifier.classes()
        best = classifier.probabilities(asked.table).argmax(axis=1)
        true += asked.labels
        answers += [classes[k] for k in best]
    matrix = confusion(true, answers)
    return {
        "classifier": f"{learner.component.qualified} {learner.component.version}",
        "protocol": OTHER_TRIALS,
        **rate_as_json(RecognitionRate(matrix.correct, matrix.n)),
        "labels": list(matrix.labels),
        "confusion": [list(row) for row in matrix.counts],
        "protocols": {},
        "controls": {},
        "warnings": [],
        "notes": [f"trained on {len(data)} trials of {data.source}, judged on {matrix.n} of {test.source}"],
    }


def _tree(
    learner: SelectedComponent, data: Labelled, target: Target, seed: int
) -> list[dict[str, Any]] | None:
    """Return the tree that the classifier grows on all trials, None where it grows none or several."""
    if target == "state" and len({class_of(label) for label in data.labels}) > 1:
        return None
    labelled = data.aimed(target)
    classifier = learner.create()
    classifier.fit(labelled.table, labelled.labels, seed)
    nodes: Sequence[Any] | None = classifier.tree()
    return None if nodes is None else [node.as_json() for node in nodes]
