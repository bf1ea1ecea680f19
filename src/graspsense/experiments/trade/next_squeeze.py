"""The task `next_squeeze`: stop when sure enough, else squeeze with the force that promises most per second.

At the contact the width alone gives a first answer; each squeeze then gives one from all six features, at its own
force. How much an answer is worth is known from a cross validation within the training trials: how often each label
is given it. By that (Bayes' rule, the squeezes taken as independent of each other) the answers so far become a
belief, and each squeeze that could follow promises so much information in so many seconds.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import field, frozen
from attrs.validators import ge

from graspsense.core.config import settings_from
from graspsense.core.strict import structured
from graspsense.evaluation.evaluate import INSTANCE_HELD_OUT
from graspsense.evaluation.folds import instance_held_out
from graspsense.experiments.trade.costs import CostOnly
from graspsense.experiments.trade.judging import aimed, entry, learners_of
from graspsense.sources.simulated import simulated
from graspsense.sources.trial_source import Source, groups_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.config import SelectedComponent
    from graspsense.core.features import FeatureTable

    Floats = NDArray[np.float64]

OPENED_M: Final = 0.010
"""Between squeezes the fingers open past the contact by this, as in the authors' code, and close again."""
PRIOR: Final = 1.0
"""Trials that every label counts for besides its own, spread over all answers: few were seen of each."""


@frozen(kw_only=True)
class NextSqueeze(CostOnly):
    """The keys of `[judge]`."""

    forces_n: tuple[float, ...] = (14.0, 17.0, 20.0, 23.0)
    fixed_n: float = 20.0
    """The single squeeze that it is held against."""
    sure: tuple[float, ...] = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Thresholds: how probable a label has to be to stop. Each is a case."""
    most: int = field(default=3, validator=ge(1))
    """Squeezes at the most."""
    folds: int = field(default=5, validator=ge(2))


@frozen(kw_only=True, eq=False)
class Squeezed:
    """What one force gives: the answer to each trial, as the number of a label, and the seconds it took."""

    answer: NDArray[np.int64]
    seconds: Floats


@frozen(kw_only=True, eq=False)
class Promise:
    """What was learned of one force: how often each label (a row) gets each answer, and its seconds by label."""

    confusion: Floats
    seconds: Floats

    def rate(self, belief: Floats, again_s: float) -> float:
        """Return the information, in bits per second, that a squeeze is expected to give."""
        answer = belief @ self.confusion
        gained = _entropy(answer) - float(belief @ [_entropy(row) for row in self.confusion])
        return gained / (float(belief @ self.seconds) + again_s)


def _entropy(shares: Floats) -> float:
    some = shares[shares > 0.0]
    return float(-(some * np.log2(some)).sum())


def decide(
    trial: int,
    contact: tuple[Squeezed, Promise],
    squeezed: Mapping[float, Squeezed],
    promises: Mapping[float, Promise],
    sure: float,
    most: int,
    again_s: float,
) -> tuple[int, float, int]:
    """Return the answer for a trial, the seconds it took from the contact on, and how many squeezes."""
    felt, known = contact
    belief = _scaled(known.confusion[:, felt.answer[trial]])
    # The squeezes feel the width as well, so they take the place of what the width alone said.
    evidence = np.ones(len(belief))
    seconds = 0.0
    used: list[float] = []
    while True:
        left = [force for force in squeezed if force not in used]
        opens = again_s if used else 0.0
        best = max(left, key=lambda force: promises[force].rate(belief, opens), default=None)
        if best is None or belief.max() >= sure or len(used) >= most:
            return int(belief.argmax()), seconds, len(used)
        one = squeezed[best]
        seconds += opens + float(one.seconds[trial])
        evidence = evidence * promises[best].confusion[:, one.answer[trial]]
        belief = _scaled(evidence)
        used.append(best)


def _scaled(weights: Floats) -> Floats:
    shares: Floats = weights / weights.sum()
    return shares


def next_squeeze(params: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the rate and the mean seconds of fixed squeezes and of the sequential choice at each threshold."""
    judge = structured(params["judge"], NextSqueeze, "[judge]")
    groups = groups_of(structured(params["data"], Source, "[data]"))
    tables: dict[float, FeatureTable] = {}
    data = None
    for force in judge.forces_n:
        settings = {table: dict(keys) for table, keys in params["settings"].items()}
        settings["controller"]["probing_force_n"] = force
        # The same seed: each force squeezes the same thing in the same place.
        data = simulated(settings_from(settings, "the settings of the task"), groups=groups, seed=seed)
        tables[force] = data.table
    assert data is not None
    instances = data.instances or ()
    target = judge.targets[0]
    told = np.array(aimed(data.labels, target))
    labels = np.unique(told)
    learner = next(iter(learners_of(params).values()))
    speed = float(params["settings"]["controller"]["closing_speed_m_s"])
    window = float(params["settings"]["controller"].get("rest_window_s", 0.05))
    again_s = OPENED_M / speed
    durations = {
        force: np.nan_to_num(
            table.values[:, table.names.index("delta_t")],
            nan=float(params["settings"]["controller"].get("steady_timeout_s", 3.0)),
        )
        + window
        for force, table in tables.items()
    }
    chosen: dict[str, list[tuple[str, str, float, int]]] = {}
    folds = instance_held_out(told.tolist(), instances, judge.folds, seed)
    for fold in range(int(folds.max()) + 1):
        test, training = np.flatnonzero(folds == fold), np.flatnonzero(folds != fold)
        width = next(iter(tables.values())).columns(["p_first"])

        def learned(
            table: FeatureTable,
            took: Floats,
            training: NDArray[np.int64] = training,
            test: NDArray[np.int64] = test,
        ) -> tuple[Squeezed, Promise]:
            known = told[training].tolist()
            answer = _answers(learner, table, training, known, test, labels, seed)
            things = [instances[i] for i in training.tolist()]
            promise = _promise(learner, table, training, known, things, took, labels, seed)
            return Squeezed(answer=answer, seconds=took[test]), promise

        contact = learned(width, np.zeros(len(told)))
        of_force = {force: learned(table, durations[force]) for force, table in tables.items()}
        squeezed = {force: one for force, (one, _) in of_force.items()}
        promises = {force: one for force, (_, one) in of_force.items()}
        for k, i in enumerate(test.tolist()):
            for force in tables:
                best = int(squeezed[force].answer[k])
                row = (str(told[i]), str(labels[best]), float(squeezed[force].seconds[k]), 1)
                chosen.setdefault(fixed_name(force), []).append(row)
            for sure in judge.sure:
                best, took, used = decide(k, contact, squeezed, promises, sure, judge.most, again_s)
                row = (str(told[i]), str(labels[best]), took, used)
                chosen.setdefault(f"sequential, sure at {sure:g}", []).append(row)
    judged = []
    for name, rows in chosen.items():
        true, given, took_s, used_n = zip(*rows, strict=True)
        cost = math.fsum(took_s) / len(rows)
        judged.append(
            entry(name, target, true, given, INSTANCE_HELD_OUT, cost, squeezes=sum(used_n) / len(rows))
        )
    return {"source": data.source, "simulated": True, "notes": list(data.notes), "judged": judged}


def fixed_name(force: float) -> str:
    """Return how the single squeeze of a force is called."""
    return f"one squeeze of {force:g} N"


def _answers(
    learner: SelectedComponent,
    table: FeatureTable,
    training: NDArray[np.int64],
    known: Sequence[str],
    test: NDArray[np.int64],
    labels: NDArray[np.str_],
    seed: int,
) -> NDArray[np.int64]:
    """Return the answer to each of these trials, as the number of its label."""
    classifier = learner.create()
    classifier.fit(table.rows(training), known, seed)
    numbers = np.searchsorted(labels, np.array(classifier.classes()))
    answers: NDArray[np.int64] = numbers[classifier.probabilities(table.rows(test)).argmax(axis=1)]
    return answers


def _promise(
    learner: SelectedComponent,
    table: FeatureTable,
    training: NDArray[np.int64],
    known: Sequence[str],
    things: Sequence[str],
    seconds: Floats,
    labels: NDArray[np.str_],
    seed: int,
) -> Promise:
    folds = instance_held_out(known, things, 3, seed)
    counts = np.full((len(labels), len(labels)), PRIOR / len(labels))
    true = np.searchsorted(labels, np.array(known))
    for fold in range(int(folds.max()) + 1):
        inner, other = np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)
        given = _answers(
            learner, table, training[inner], [known[i] for i in inner.tolist()], training[other], labels, seed
        )
        np.add.at(counts, (true[other], given), 1.0)
    means = np.array([seconds[training[true == k]].mean() for k in range(len(labels))])
    return Promise(confusion=counts / counts.sum(axis=1, keepdims=True), seconds=means)
