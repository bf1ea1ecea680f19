"""Prediction sets: the labels that cannot be ruled out, by conformal prediction with held-out instances.

A label belongs to the set of a trial if its score reaches a threshold. The score is the probability by the classifier;
of equal probabilities, that label is ahead whose training trials lie closer (a tree gives most labels the probability
0). The predicted label is always a member, so its score counts as larger than any other.

The threshold of a label comes from trials that were predicted without their instance, as in cross-conformal prediction
(V. Vovk, Ann. Math. Artif. Intell. 74 (2015) 9). The rank of such a trial is the share of the label's trials of other
instances whose true label has a larger score. The level is the rank that the asked share of the trials does not exceed,
and the threshold the score of which that share is larger. Trials of one instance resemble each other, so instances have
equal weights, shared by their trials. Both quantiles are interpolated between the trials. Split conformal prediction
takes the next trial instead, which guarantees the coverage for any number of instances, but with few it covers more
than is asked: 94 % with 15 instances for 90 %.

A label with enough instances has a threshold of its own (class-wise sets); the other labels share that of all labels
together. No label is covered less than it is recognised, because the prediction is a member: a label that is recognised
in 97 % of its trials is covered in at least 97 %.

The scores are cross-validated, but the prediction is by the model of all trials, so the coverage is not guaranteed:
`graspsense evaluate` measures it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.learn.stored_values import StoredValues

if TYPE_CHECKING:
    from numpy.typing import NDArray

COVERAGE: Final = 0.9
"""Share of the trials whose set shall contain the true label."""
_COVERAGES: Final = (0.01, 0.999)
"""The coverages that a stored model may have; each needs a number of units that can be counted."""
_ROUNDING: Final = 1e-9
_CLOSENESS: Final = 1e-3
"""Weight of the closeness in a score: it only matters among probabilities that are equal, or almost."""
_PREDICTED: Final = 2.0
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

    `counts` are the trials of each label and instance. The unit is `instances` if every trial has one and every label
    has several, else `trials`.

    >>> units_lacking({("full", "full#1"): 5, ("full", "full#2"): 5})
    ('instances', {'full': 7})
    >>> units_lacking({("full", None): 5})
    ('trials', {'full': 4})
    """
    named: dict[str, set[str | None]] = {}
    trials: dict[str, int] = {}
    for (label, instance), n in counts.items():
        named.setdefault(label, set()).add(instance)
        trials[label] = trials.get(label, 0) + n
    by_instance = all(None not in of and len(of) > 1 for of in named.values())
    have = {label: len(of) for label, of in named.items()} if by_instance else trials
    needed = units_needed(coverage)
    lacking = {label: max(needed - n, 0) for label, n in sorted(have.items())}
    return ("instances" if by_instance else "trials"), lacking


def scores_of(probabilities: NDArray[np.float64], closeness: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the scores of trials for labels, of the probabilities and of `Novelty.closeness` (0 to 1)."""
    return probabilities + _CLOSENESS * closeness


@frozen(kw_only=True)
class LabelThreshold:
    """The smallest score with which a label belongs to a set.

    `units` is the number of calibration units that have trials of the label. `own` says whether the threshold is
    computed from those alone; otherwise it is that of all labels together.
    """

    score: float
    units: int
    own: bool


@frozen(kw_only=True)
class PredictionSets:
    """The thresholds of all labels, from trials that were predicted by a model without their unit.

    `unit` is `instances` or `trials`. `thresholds` is empty if there are too few units; `reason` then says so.
    `unknown` of the `trials` calibration trials were called unknown: the false alarms of that rule.
    """

    coverage: float
    unit: str
    thresholds: Mapping[str, LabelThreshold]
    reason: str = ""
    unknown: int = 0
    trials: int = 0

    def of(self, scores: Mapping[str, float], label: str) -> tuple[str, ...]:
        """Return the set of a trial, the label with the largest score first; empty without thresholds.

        `label` is the prediction, which is always a member.
        """
        if not self.thresholds:
            return ()
        members = [name for name, score in scores.items() if name == label or self._contains(name, score)]
        return tuple(sorted(members, key=lambda name: (name != label, -scores[name])))

    def members(self, scores: NDArray[np.float64], classes: Sequence[str]) -> NDArray[np.bool_]:
        """Return which classes belong to the set of each trial; NaN is not a possible answer.

        `scores` has shape (trials, classes). Raises KeyError if a class that is possible has no threshold.
        """
        inside = np.zeros(scores.shape, dtype=np.bool_)
        for k, name in enumerate(classes):
            possible = ~np.isnan(scores[:, k])
            if possible.any():
                least = self.thresholds[name].score - _ROUNDING
                inside[possible, k] = scores[possible, k] >= least
        inside[np.arange(len(inside)), np.nanargmax(scores, axis=1)] = True
        return inside

    def _contains(self, label: str, score: float) -> bool:
        return score >= self.thresholds[label].score - _ROUNDING

    @property
    def in_words(self) -> str:
        """How the sets are calibrated, and how many more units a label needs for a threshold of its own."""
        if not self.thresholds:
            return f"none: {self.reason}"
        needed = units_needed(self.coverage)
        shared = {name: one.units for name, one in self.thresholds.items() if not one.own}
        text = f"{100 * self.coverage:.0f} % for {len(self.thresholds) - len(shared)} of {len(self.thresholds)} labels"
        if not shared:
            return (
                f"{text} ({min(one.units for one in self.thresholds.values())} {self.unit} or more of each)"
            )
        if len(shared) > 1 and len(shared) == len(self.thresholds) and len(set(shared.values())) == 1:
            lacking = f"{needed - next(iter(shared.values()))} more of each"
        else:
            lacking = ", ".join(f"{name} {needed - units} more" for name, units in sorted(shared.items()))
        return (
            f"{text}, over all labels together for the others; a label needs {needed} {self.unit}: {lacking}"
        )

    def to_json(self) -> dict[str, Any]:
        """Return the thresholds as values that JSON represents exactly."""
        return {
            "coverage": self.coverage,
            "unit": self.unit,
            "reason": self.reason,
            "unknown": self.unknown,
            "trials": self.trials,
            "thresholds": {name: [one.score, one.units, one.own] for name, one in self.thresholds.items()},
        }


def sets_from(kept: StoredValues, classes: Sequence[str]) -> PredictionSets:
    """Return the sets of a stored model. Raises DataDamaged if they do not fit its classes."""
    thresholds, stored = {}, kept.table("thresholds")
    for name in stored:
        if len(stored.items(name)) != 3:
            raise stored.refusal(
                name, "expected a score, a number of units, and whether it is the label's own"
            )
        entry = StoredValues(
            dict(zip(("score", "units", "own"), stored.items(name), strict=True)), stored.field(name)
        )
        thresholds[name] = LabelThreshold(
            score=entry.number("score"), units=entry.whole("units"), own=entry.flag("own")
        )
    if thresholds and set(thresholds) != set(classes):
        raise kept.refusal("thresholds", "the thresholds of its prediction sets are not those of its labels")
    trials = kept.whole("trials")
    return PredictionSets(
        coverage=kept.number("coverage", *_COVERAGES),
        unit=kept.choice("unit", ("instances", "trials")),
        thresholds=thresholds,
        reason=kept.text("reason"),
        unknown=kept.whole("unknown", most=trials),
        trials=trials,
    )


def sets_of(
    true_scores: NDArray[np.float64],
    right: Sequence[bool],
    labels: Sequence[str],
    instances: Sequence[str] | None,
    coverage: float = COVERAGE,
) -> PredictionSets:
    """Return the sets that held-out trials calibrate.

    `true_scores` are the scores of the true labels, by models trained without the instance of the trial; `right` says
    which of these trials were predicted correctly. Without `instances`, each trial is a unit.
    """
    unit = "trials" if instances is None else "instances"
    units = np.array([str(i) for i in range(len(labels))] if instances is None else instances)
    given = np.array(labels)
    needed = units_needed(coverage)
    count = len(np.unique(units))
    if count < needed:
        reason = f"{count} calibration {unit}, {100 * coverage:.0f} % needs {needed}"
        return PredictionSets(coverage=coverage, unit=unit, thresholds={}, reason=reason)
    scores = np.where(right, _PREDICTED, true_scores)
    thresholds = {}
    for name in sorted(set(labels)):
        rows = given == name
        of_label = len(np.unique(units[rows]))
        own = of_label >= needed
        value = (
            _threshold(scores[rows], units[rows], coverage) if own else _threshold(scores, units, coverage)
        )
        thresholds[name] = LabelThreshold(score=value, units=of_label, own=own)
    return PredictionSets(coverage=coverage, unit=unit, thresholds=thresholds)


def _threshold(scores: NDArray[np.float64], units: NDArray[np.str_], coverage: float) -> float:
    """Return the score of which a larger one has the level, as a share of the trials, interpolated between scores."""
    names, unit_of, trials_of_unit = np.unique(units, return_inverse=True, return_counts=True)
    weights = 1.0 / trials_of_unit[unit_of]
    larger = _weight_above(scores, weights)
    own = np.empty(len(scores))
    for rows in np.split(np.argsort(unit_of, kind="stable"), np.cumsum(trials_of_unit)[:-1]):
        own[rows] = _weight_above(scores[rows], weights[rows])
    ranks = (larger - own) / (len(names) - 1)
    order = np.argsort(ranks, kind="stable")
    reached = np.cumsum(weights[order]) / len(names)
    level = np.interp(coverage, reached, ranks[order])
    falling = np.argsort(-scores, kind="stable")
    return float(np.interp(level, larger[falling] / len(names), scores[falling]))


def _weight_above(scores: NDArray[np.float64], weights: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return, for each score, the sum of the weights of the larger ones."""
    order = np.argsort(-scores, kind="stable")
    above: NDArray[np.float64] = np.concatenate(([0.0], np.cumsum(weights[order])))
    return above[np.searchsorted(-scores[order], -scores, side="left")]


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
    first = int(np.searchsorted(reached, coverage - _ROUNDING))
    return float(scores[order[min(first, len(order) - 1)]])
