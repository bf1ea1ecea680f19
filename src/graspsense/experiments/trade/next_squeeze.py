"""The task `next_squeeze`: stop when sure enough, or else squeeze with the most informative force per second.

At contact, the width alone gives a first prediction. Each squeeze then gives a prediction from all features, at its own
force. A cross validation within the training trials measures how often each label gets each prediction at each force.
With these frequencies, Bayes' rule turns the predictions so far into probabilities of the labels, taking squeezes as
independent. The next squeeze is the one with the largest expected information per second.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import field, frozen
from attrs.validators import ge, le

from graspsense.core.components.strict import structured
from graspsense.core.settings.resolved import settings_from
from graspsense.evaluation.folds import INSTANCE_HELD_OUT, instance_held_out
from graspsense.experiments.recognise import classifiers_of
from graspsense.experiments.task_results import ClassifierResult, RecognitionResult
from graspsense.experiments.trade.costs import CostSettings
from graspsense.experiments.trade.squeezes import MOST_SQUEEZES
from graspsense.experiments.trade.trade_task import (
    simulated_result,
    target_labels,
    trial_groups,
)
from graspsense.recording.controls import width_feature
from graspsense.sources.simulated import simulated

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled
    from graspsense.core.settings.selected import SelectedComponent
    from graspsense.core.values.features import FeatureTable

    Floats = NDArray[np.float64]

OPENED_M: Final = 0.010
"""Between squeezes the fingers open past the contact by this, as in the authors' code, and close again."""
PRIOR: Final = 1.0
"""Pseudo-trials per label, spread evenly over all predictions, because few trials of each label are available."""
INNER_FOLDS: Final = 3


@frozen(kw_only=True)
class NextSqueezeSettings(CostSettings):
    """The keys of `[judge]`."""

    forces_n: tuple[float, ...] = (14.0, 17.0, 20.0, 23.0)
    fixed_n: float = 20.0
    """The force of the single squeeze that the sequential choice is compared with."""
    sure: tuple[float, ...] = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9)
    """Thresholds of the probability at which to stop. Each is a case."""
    most: int = field(default=3, validator=[ge(1), le(MOST_SQUEEZES)])
    """Largest number of squeezes."""
    folds: int = field(default=5, validator=ge(2))


@frozen(kw_only=True, eq=False)
class SqueezePredictions:
    """The predictions for the test trials at one force, as numbers of labels, and the seconds of each squeeze."""

    answer: NDArray[np.int64]
    seconds: Floats


@frozen(kw_only=True, eq=False)
class SqueezeStatistics:
    """Squeezes at one force: how often each label (row) gets each prediction, and its mean seconds."""

    confusion: Floats
    seconds: Floats

    def information_rate(self, belief: Floats, again_s: float) -> float:
        """Return the expected information of a squeeze, in bits per second.

        `belief` holds the probabilities of the labels, `again_s` the time to open and close before the squeeze.
        """
        answer = belief @ self.confusion
        gained = _entropy(answer) - float(belief @ [_entropy(row) for row in self.confusion])
        return gained / (float(belief @ self.seconds) + again_s)


@frozen(kw_only=True, eq=False)
class ForceChoices:
    """The predictions and the statistics of every force, for one fold."""

    answers: Mapping[float, SqueezePredictions]
    statistics: Mapping[float, SqueezeStatistics]


@frozen(kw_only=True)
class Decision:
    """The predicted label as its number, the seconds from contact on, and the number of squeezes."""

    answer: int
    seconds: float
    squeezes: int


def _entropy(shares: Floats) -> float:
    some = shares[shares > 0.0]
    return float(-(some * np.log2(some)).sum())


def decide(
    trial: int,
    contact: tuple[SqueezePredictions, SqueezeStatistics],
    choices: ForceChoices,
    *,
    sure: float,
    most: int,
    again_s: float,
) -> Decision:
    """Return the decision for a trial.

    `contact` holds the predictions from the width alone. Squeezing stops when a label has the probability `sure`, or
    after `most` squeezes. `again_s` is the time to open and close between squeezes.
    """
    after_contact, known = contact
    belief = _normalised(known.confusion[:, after_contact.answer[trial]])
    # The squeezes measure the width as well, so they replace the prediction from the width alone.
    evidence = np.ones(len(belief))
    seconds = 0.0
    used: list[float] = []
    while True:
        left = [force for force in choices.answers if force not in used]
        opens = again_s if used else 0.0
        best = max(
            left, key=lambda force: choices.statistics[force].information_rate(belief, opens), default=None
        )
        if best is None or belief.max() >= sure or len(used) >= most:
            return Decision(answer=int(belief.argmax()), seconds=seconds, squeezes=len(used))
        answers = choices.answers[best]
        seconds += opens + float(answers.seconds[trial])
        evidence = evidence * choices.statistics[best].confusion[:, answers.answer[trial]]
        belief = _normalised(evidence)
        used.append(best)


def _normalised(weights: Floats) -> Floats:
    shares: Floats = weights / weights.sum()
    return shares


def next_squeeze(params: Mapping[str, Any], seed: int) -> RecognitionResult:
    """Return the rate and the mean seconds of single squeezes, and of the sequential choice at each threshold."""
    settings = structured(params["judge"], NextSqueezeSettings, "[judge]")
    data, tables = _tables(params, settings, seed)
    target = settings.targets[0]
    learning = _Learning(
        learner=next(iter(classifiers_of(params).values())),
        true=np.array(target_labels(data.labels, target)),
        instances=data.instances or (),
        seed=seed,
    )
    decisions = _decisions(params, settings, learning, tables)
    results = []
    for name, rows in decisions.items():
        results.append(
            ClassifierResult.from_answers(
                name,
                target,
                INSTANCE_HELD_OUT,
                [str(learning.true[trial]) for trial, _ in rows],
                [str(learning.labels[decision.answer]) for _, decision in rows],
                data.rows(np.array([trial for trial, _ in rows])),
                cost=math.fsum(decision.seconds for _, decision in rows) / len(rows),
                squeezes=sum(decision.squeezes for _, decision in rows) / len(rows),
            )
        )
    return simulated_result(data, results)


def fixed_name(force: float) -> str:
    """Return the name of the single squeeze with this force."""
    return f"one squeeze of {force:g} N"


def _tables(
    params: Mapping[str, Any], settings: NextSqueezeSettings, seed: int
) -> tuple[Labelled, dict[float, FeatureTable]]:
    """Return the trials, and their features at each force. The same seed gives the same objects and placements."""
    tables: dict[float, FeatureTable] = {}
    for force in settings.forces_n:
        values = {table: dict(keys) for table, keys in params["settings"].items()}
        values["controller"]["probing_force_n"] = force
        data = simulated(
            settings_from(values, "the settings of the task"), groups=trial_groups(params), seed=seed
        )
        tables[force] = data.table
    return data, tables


def _decisions(
    params: Mapping[str, Any],
    settings: NextSqueezeSettings,
    learning: _Learning,
    tables: Mapping[float, FeatureTable],
) -> dict[str, list[tuple[int, Decision]]]:
    """Return each trial with its decision, for each single squeeze and each threshold."""
    controller = params["settings"]["controller"]
    again_s = OPENED_M / float(controller["closing_speed_m_s"])
    seconds = {force: _squeeze_seconds(table, controller) for force, table in tables.items()}
    shortest = next(iter(tables.values()))
    width = shortest.columns([width_feature(shortest.names) or shortest.names[0]])
    decisions: dict[str, list[tuple[int, Decision]]] = {}
    folds = instance_held_out(learning.true.tolist(), learning.instances, settings.folds, learning.seed)
    for fold in range(int(folds.max()) + 1):
        test, training = np.flatnonzero(folds == fold), np.flatnonzero(folds != fold)
        contact = learning.learned(width, np.zeros(len(learning.true)), training, test)
        learned = {
            force: learning.learned(table, seconds[force], training, test) for force, table in tables.items()
        }
        choices = ForceChoices(
            answers={force: answers for force, (answers, _) in learned.items()},
            statistics={force: statistics for force, (_, statistics) in learned.items()},
        )
        for k, i in enumerate(test.tolist()):
            for force, answers in choices.answers.items():
                single = Decision(
                    answer=int(answers.answer[k]), seconds=float(answers.seconds[k]), squeezes=1
                )
                decisions.setdefault(fixed_name(force), []).append((i, single))
            for sure in settings.sure:
                decision = decide(k, contact, choices, sure=sure, most=settings.most, again_s=again_s)
                decisions.setdefault(f"sequential, sure at {sure:g}", []).append((i, decision))
    return decisions


def _squeeze_seconds(table: FeatureTable, controller: Mapping[str, Any]) -> Floats:
    """Return the seconds of each squeeze: until rest, and the window that detects it."""
    until_rest: Floats = np.nan_to_num(
        table.values[:, table.names.index("delta_t")],
        nan=float(controller.get("steady_timeout_s", 3.0)),
    )
    return until_rest + float(controller.get("rest_window_s", 0.05))


@frozen(kw_only=True, eq=False, slots=False)
class _Learning:
    """What the models of all forces and folds share."""

    learner: SelectedComponent
    true: NDArray[np.str_]
    """The true label of each trial."""
    instances: Sequence[str]
    seed: int

    @property
    def labels(self) -> NDArray[np.str_]:
        """The different labels, sorted."""
        return np.unique(self.true)

    def learned(
        self, table: FeatureTable, seconds: Floats, training: NDArray[np.int64], test: NDArray[np.int64]
    ) -> tuple[SqueezePredictions, SqueezeStatistics]:
        """Return the predictions for the test trials, and the statistics measured within the training trials."""
        answers = SqueezePredictions(answer=self._answers(table, training, test), seconds=seconds[test])
        return answers, self._statistics(table, training, seconds)

    def _answers(
        self, table: FeatureTable, training: NDArray[np.int64], test: NDArray[np.int64]
    ) -> NDArray[np.int64]:
        """Return the prediction for each test trial, as the number of its label."""
        classifier = self.learner.create()
        classifier.fit(table.rows(training), self.true[training].tolist(), self.seed)
        numbers = np.searchsorted(self.labels, np.array(classifier.classes()))
        answers: NDArray[np.int64] = numbers[classifier.probabilities(table.rows(test)).argmax(axis=1)]
        return answers

    def _statistics(
        self, table: FeatureTable, training: NDArray[np.int64], seconds: Floats
    ) -> SqueezeStatistics:
        known = self.true[training].tolist()
        instances = [self.instances[i] for i in training.tolist()]
        folds = instance_held_out(known, instances, INNER_FOLDS, self.seed)
        n = len(self.labels)
        counts = np.full((n, n), PRIOR / n)
        true = np.searchsorted(self.labels, np.array(known))
        for fold in range(int(folds.max()) + 1):
            inner, other = np.flatnonzero(folds != fold), np.flatnonzero(folds == fold)
            answers = self._answers(table, training[inner], training[other])
            np.add.at(counts, (true[other], answers), 1.0)
        means = np.array([seconds[training[true == k]].mean() for k in range(n)])
        return SqueezeStatistics(confusion=counts / counts.sum(axis=1, keepdims=True), seconds=means)
