"""Prediction sets: the labels that cannot be ruled out, by conformal prediction with held-out instances.

A label belongs to the set of a trial if its score reaches a threshold. The score is the probability by the classifier;
of equal probabilities, that label is ahead whose training trials lie closer (a tree gives most labels the probability
0). The predicted label is always a member, so its score counts as larger than any other.

The threshold of a label comes from trials of it that were predicted without their instance, as in cross-conformal
prediction (V. Vovk, Ann. Math. Artif. Intell. 74 (2015) 9): the largest score that is reached as often as asked for. So
does the threshold of a class of support (`learn.certainty`), from all trials in it. A label belongs to a set if it
reaches either of the two, so that the sets hold for each label and for answers from few training trials (Mondrian
conformal prediction, V. Vovk, A. Gammerman and G. Shafer, Algorithmic Learning in a Random World, 2005, section 4.5). A
label with too few units is a member of every set.

A set keeps a single label only if the answer is as certain as the sets shall be; otherwise the next label is added.

The scores are cross-validated, but the prediction is by the model of all trials, so the coverage is not guaranteed:
`graspsense evaluate` measures it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.certainty import Certainty
from graspsense.core.learn.stored_values import StoredValues
from graspsense.core.values.label_text import natural_order

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled

COVERAGE: Final = 0.9
"""Share of the trials whose set shall contain the true label."""
WITHIN_REACH: Final = 0.98
"""Share of held-out trials for whose like something is told: of the others, too few show how often they are right."""
COVERAGES: Final = (0.01, 0.999)
"""The coverages that a stored model may have; each needs a number of units that can be counted."""
UNITS: Final = ("instances", "sessions", "groups", "trials")
"""What is held out: named objects, sessions, trials that belong together (`learn.groups`), or single trials."""
_ROUNDING: Final = 1e-9
NEVER_REACHED: Final = 2.0
"""The score of the predicted label, which is always a member: larger than those of all other labels."""


def units_needed(coverage: float = COVERAGE) -> int:
    """Return the smallest number n of calibration units with ceil((n + 1) coverage) <= n.

    >>> units_needed(0.9), units_needed(0.95)
    (9, 19)
    """
    n = 1
    while math.ceil((n + 1) * coverage - _ROUNDING) > n:
        n += 1
    return n


def units_lacking(
    counts: Mapping[tuple[str, str | None], int], coverage: float = COVERAGE
) -> tuple[str, dict[str, int]]:
    """Return the unit of exchangeability, and how many more units each label needs for a threshold of its own.

    `counts` are the trials of each label and instance. The unit is `instances` if every trial has one and they can be
    held out, else `trials`.

    >>> units_lacking({("full", "full#1"): 5, ("full", "full#2"): 5})
    ('instances', {'full': 7})
    >>> units_lacking({("full", None): 5})
    ('trials', {'full': 4})
    """
    trials: Counter[str] = Counter()
    for (label, _), n in counts.items():
        trials[label] += n
    by_instance = can_be_held_out(counts) and all(instance is not None for _, instance in counts)
    have = Counter(label for label, _ in counts) if by_instance else trials
    needed = units_needed(coverage)
    lacking = {label: max(needed - have[label], 0) for label in natural_order(have)}
    return ("instances" if by_instance else "trials"), lacking


def can_be_held_out(named: Iterable[tuple[str, str | None]]) -> bool:
    """Return whether whole instances can be held out, of these different pairs of a label and an instance.

    Most labels need several. The only one of a label is held out as well: no model knows the label then, and how often
    it is recognised is not known.
    """
    of_label = Counter(label for label, _ in named)
    return 2 * sum(instances > 1 for instances in of_label.values()) > len(of_label)


def exchangeable_instances(labelled: Labelled) -> tuple[str, ...] | None:
    """Return the instances of the trials; None if they are not known, or named ones cannot be held out."""
    if labelled.instances is None or labelled.grouped:
        return labelled.instances
    named = {*zip(labelled.labels, labelled.instances, strict=True)}
    return labelled.instances if can_be_held_out(named) else None


@frozen(kw_only=True)
class LabelThreshold:
    """The smallest score with which a label belongs to a set.

    `units` is the number of calibration units that have trials of the label. With too few of them the score is None:
    the label is then a member of every set.
    """

    score: float | None
    units: int


@frozen(kw_only=True)
class PredictionSets:
    """The thresholds of all labels, from trials that were predicted by a model without their unit.

    `unit` is one of `UNITS`. `of_support` has the threshold of each class of support, which holds for all
    labels. `thresholds` is empty if no label has enough units; `reason` then says so. `unknown` of the `trials`
    calibration trials were called unknown: the false alarms of that rule.
    """

    coverage: float
    unit: str
    thresholds: Mapping[str, LabelThreshold]
    of_support: tuple[float, ...] = (NEVER_REACHED,)
    reason: str = ""
    unknown: int = 0
    trials: int = 0

    def members(self, answers: Answers, certainty: Certainty) -> NDArray[np.bool_]:
        """Return which classes belong to the set of each trial, of the shape of the scores.

        A label without a threshold, which no calibration trial had, is a member like one with too few units.
        """
        scores = answers.scores
        own = [self.thresholds[name].score if name in self.thresholds else None for name in answers.classes]
        of_label = np.array([-math.inf if score is None else score for score in own])
        of_support = np.array(self.of_support)[certainty.class_of(answers.support)]
        inside = scores >= np.minimum(of_support[:, np.newaxis], of_label) - _ROUNDING
        inside[np.arange(len(inside)), answers.columns] = True
        alone = np.flatnonzero(
            (inside.sum(axis=1) == 1)
            & ~(certainty.rate(answers) >= self.coverage)
            & ((~np.isnan(scores)).sum(axis=1) > 1)
        )
        others = np.where(np.isnan(scores), -np.inf, scores)[alone]
        others[np.arange(len(alone)), answers.columns[alone]] = -np.inf
        inside[alone, others.argmax(axis=1) if len(alone) else alone] = True
        return np.asarray(inside)

    @property
    def uncalibrated(self) -> tuple[str, ...]:
        """The labels that are in every set, because they have too few units."""
        return tuple(sorted(name for name, threshold in self.thresholds.items() if threshold.score is None))

    @property
    def in_words(self) -> str:
        """How the sets are calibrated, and how many more units a label needs to be calibrated."""
        if not self.thresholds:
            return f"none: {self.reason}"
        needed = units_needed(self.coverage)
        shared = self.uncalibrated
        text = f"{100 * self.coverage:.0f} % for {len(self.thresholds) - len(shared)} of {len(self.thresholds)} labels"
        if not shared:
            fewest = min(threshold.units for threshold in self.thresholds.values())
            held_for = "" if self.unit == "instances" else ", for grasps of the same objects only"
            return f"{text} ({fewest} {self.unit} or more of each{held_for})"
        lacking = ", ".join(f"{name} {needed - self.thresholds[name].units} more" for name in shared)
        return f"{text}; the others are in every set; a label needs {needed} {self.unit}: {lacking}"

    def to_json(self) -> dict[str, Any]:
        """Return the thresholds as values that JSON represents exactly."""
        return {
            "coverage": self.coverage,
            "unit": self.unit,
            "reason": self.reason,
            "unknown": self.unknown,
            "trials": self.trials,
            "thresholds": {
                name: {"units": threshold.units, "score": threshold.score}
                for name, threshold in self.thresholds.items()
            },
            "of_support": list(self.of_support),
        }


def sets_from(kept: StoredValues, classes: Sequence[str], support_classes: int) -> PredictionSets:
    """Return the sets of a stored model. Raises DataDamaged if they do not fit its labels or its classes of support."""
    thresholds, stored = {}, kept.table("thresholds")
    for name in stored:
        entry = stored.table(name)
        score = None if entry.value("score") is None else entry.number("score")
        thresholds[name] = LabelThreshold(score=score, units=entry.whole("units"))
    if thresholds and set(thresholds) != set(classes):
        raise kept.refusal("thresholds", "the thresholds of its prediction sets are not those of its labels")
    trials = kept.whole("trials")
    return PredictionSets(
        coverage=kept.number("coverage", *COVERAGES),
        unit=kept.choice("unit", UNITS),
        thresholds=thresholds,
        of_support=tuple(kept.numbers("of_support", (support_classes if thresholds else None,)).tolist()),
        reason=kept.text("reason"),
        unknown=kept.whole("unknown", most=trials),
        trials=trials,
    )


def sets_of(
    answers: Answers,
    labels: Sequence[str],
    instances: Sequence[str] | None,
    certainty: Certainty,
    unit: str = "instances",
) -> PredictionSets:
    """Return the sets that held-out trials calibrate.

    `answers` are by models that were trained without the instance of the trial, `labels` the true labels. Without
    `instances`, each trial is a unit. `certainty` has the classes of support, `unit` is one of `UNITS`.
    """
    truth = answers.columns_of(labels)
    units = np.array([str(i) for i in range(len(truth))] if instances is None else instances)
    needed = units_needed()
    scores = answers.scores[np.arange(len(truth)), truth]
    scores = np.where(answers.columns == truth, NEVER_REACHED, scores)
    thresholds = {}
    for k in np.unique(truth).tolist():
        rows = truth == k
        of_label = len(np.unique(units[rows]))
        score = calibrated_threshold(scores[rows], units[rows], COVERAGE) if of_label >= needed else None
        thresholds[answers.classes[k]] = LabelThreshold(score=score, units=of_label)
    if all(threshold.score is None for threshold in thresholds.values()):
        most = max((threshold.units for threshold in thresholds.values()), default=0)
        reason = f"a label has at most {most} calibration {unit}, and {100 * COVERAGE:.0f} % needs {needed}"
        return PredictionSets(coverage=COVERAGE, unit=unit, thresholds={}, reason=reason)
    support_class = certainty.class_of(answers.support)
    of_support = [
        calibrated_threshold(scores[rows], units[rows], COVERAGE)
        for rows in (support_class == number for number in range(int(support_class.max()) + 1))
    ]
    return PredictionSets(
        coverage=COVERAGE,
        unit=unit,
        thresholds=thresholds,
        # With a single class, the thresholds of the labels suffice.
        of_support=tuple(of_support) if len(of_support) > 1 else (NEVER_REACHED,),
    )


def reach_of(outside: NDArray[np.float64], units: NDArray[np.str_]) -> float:
    """Return the distance within which nearly all held-out trials were, of those in `outside` (`Novelty.outside`)."""
    return -calibrated_threshold(-outside, units, WITHIN_REACH)


def calibrated_threshold(scores: NDArray[np.float64], units: NDArray[np.str_], coverage: float) -> float:
    """Return the largest score that the weighted share `coverage` of the trials reaches.

    `units` names the unit of exchangeability of each trial. Each of K units has the weight 1 / (K + 1), shared by its
    trials, and the same weight belongs to the unit that is not known yet (Y. Lee, R. F. Barber and R. Willett,
    arXiv:2306.06342, section 3).
    """
    _, unit_of, trials_of_unit = np.unique(units, return_inverse=True, return_counts=True)
    weights = 1.0 / ((len(trials_of_unit) + 1) * trials_of_unit[unit_of])
    order = np.argsort(-scores, kind="stable")
    reached = np.cumsum(weights[order])
    cut = int(np.searchsorted(reached, coverage - _ROUNDING))
    return float(scores[order[min(cut, len(order) - 1)]])
