"""How far a prediction can be trusted: prediction sets from held-out trials, their coverage, and reliability."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.certainty import Certainty, certainty_of
from graspsense.core.learn.conformal import (
    COVERAGE,
    PredictionSets,
    exchangeable_instances,
    reach_of,
    sets_of,
    units_needed,
)
from graspsense.core.learn.confounding import confounded
from graspsense.core.learn.labelled import Labelled
from graspsense.core.learn.model import Model
from graspsense.core.values.errors import ConfigError
from graspsense.evaluation.crossval import ClassifierFactory, FitRefused, cross_validate
from graspsense.evaluation.folds import Folds, held_out, splits
from graspsense.evaluation.intervals import RecognitionRate, effect_of

FOLDS: Final = 10
BINS: Final = 10
"""Number of bins of equal width in which probabilities are compared with rates."""

RateOf = Callable[[Sequence[bool], Sequence[int] | None], RecognitionRate]


@frozen(kw_only=True)
class SetCoverage:
    """The share of held-out trials whose prediction set contains the true label, and the size of the sets.

    A label is covered at least as often as it is recognised, since the prediction is a member. `covered_below` is the
    share over the labels that are recognised less often than the coverage asked for; None if there are none.
    `mean_size` is the mean number of labels in a set, `single` the share of sets with one label. They are None if no
    set could be calibrated; `reason` then says why.
    """

    asked: float
    unit: str
    covered: RecognitionRate | None = None
    covered_below: RecognitionRate | None = None
    by_label: Mapping[str, RecognitionRate] = field(factory=dict)
    mean_size: float | None = None
    single: RecognitionRate | None = None
    reason: str = ""


@frozen
class ReliabilityBin:
    """Trials whose predicted label has about the same probability: the mean of it, and the rate of these trials."""

    probability: float
    rate: RecognitionRate


@frozen
class Reliability:
    """How well probabilities agree with rates.

    `brier` is the mean over the trials of the squared differences between the probabilities and the truth (0 for each
    wrong label, 1 for the true one), summed over the labels: 0 is perfect, 2 the worst (G. W. Brier, Mon. Weather Rev.
    78 (1950) 1). `calibration_error` is the mean over the trials of the difference between the probability of the
    predicted label and the rate, in absolute value, of the bin that the trial is in (M. P. Naeini, G. F. Cooper and
    M. Hauskrecht, AAAI 2015).
    """

    brier: float
    calibration_error: float
    curve: tuple[ReliabilityBin, ...]
    uncalibrated_error: float | None = None
    """The calibration error of the probabilities that the classifier itself gives, before calibration."""


_Calibration = tuple[Certainty, PredictionSets]
"""What held-out trials tell of later answers."""


def calibrated(model: Model, learner: ClassifierFactory, labelled: Labelled, seed: int) -> Model:
    """Return a model of these trials with certainty and prediction sets, from cross-validation on them.

    Whole instances are held out where most labels have several; otherwise each trial is a unit.
    """
    try:
        folds = held_out(labelled.labels, exchangeable_instances(labelled), FOLDS, seed)
        answers = cross_validate(learner, labelled.table, labelled.labels, folds, seed=seed)
    except (FitRefused, ConfigError) as refusal:
        return evolve(model, sets=_no_sets(labelled, str(refusal)))
    return calibrated_with(model, answers, labelled)


def calibrated_by(model: Model, labelled: Labelled) -> Model:
    """Return a model with certainty and prediction sets from trials of objects that it was not trained on.

    Trials of a label that the model does not know are left out.
    """
    classes = model.classifier.classes()
    known = labelled.rows(np.flatnonzero([label in classes for label in labelled.labels]))
    return calibrated_with(model, model.answers(known.table), known)


def calibrated_with(model: Model, answers: Answers, labelled: Labelled) -> Model:
    """Return a model with certainty and prediction sets from answers for its trials, made without their instances.

    It has neither where these trials show that labels cannot be told from how they were recorded.
    """
    held = HeldOut(answers=answers, trials=labelled, folds=np.arange(len(labelled)))
    calibration = confounded(labelled) or held.calibration(np.arange(len(labelled)))
    if isinstance(calibration, str):
        return evolve(model, sets=_no_sets(labelled, calibration))
    certainty, sets = calibration
    known = answers.known(labelled.labels)
    sets = evolve(sets, unknown=int(answers.unlike[known].sum()), trials=int(known.sum()))
    return evolve(model, certainty=certainty, sets=sets)


def _no_sets(labelled: Labelled, why: str) -> PredictionSets:
    return PredictionSets(coverage=COVERAGE, unit=_unit(labelled), thresholds={}, reason=why)


def _unit(labelled: Labelled) -> str:
    """Return what is held out of these trials, one of `conformal.UNITS`."""
    if exchangeable_instances(labelled) is None:
        return "trials"
    return "sessions" if labelled.sessions else "groups" if labelled.grouped else "instances"


@frozen(kw_only=True, eq=False)
class HeldOut:
    """Answers for held-out trials with their true labels: what every figure of certainty is computed from.

    Units are the instances of `trials` that can be held out, or single trials. What is said of the trials of a fold is
    calibrated with the other folds that were trained for it (`folds.splits`).
    """

    answers: Answers
    trials: Labelled
    folds: Folds
    within: NDArray[np.int64] | None = None

    def calibration(self, rows: NDArray[np.int64]) -> _Calibration | str:
        """Return what these trials tell, or the reason why they have too few units for anything."""
        answers, numbers = self.answers.rows(rows), rows.tolist()
        labels, named = [self.trials.labels[i] for i in numbers], exchangeable_instances(self.trials)
        own = None if named is None else [named[i] for i in numbers]
        # An instance may have several labels, such as a bottle in each of its states: these are answers of their own.
        units = [
            str(i) if own is None else f"{label} {own[k]}"
            for k, (i, label) in enumerate(zip(numbers, labels, strict=True))
        ]
        count, unit = len(set(units if own is None else own)), _unit(self.trials)
        if count < units_needed():
            return f"{count} calibration {unit}, {100 * COVERAGE:.0f} % needs {units_needed()}"
        certainty = certainty_of(answers, answers.right(labels), units, effect_of(answers.folds))
        known = answers.known(labels)  # The others are rightly outside.
        if known.any():
            certainty = evolve(certainty, reach=reach_of(answers.outside[known], np.array(units)[known]))
        return certainty, sets_of(answers, labels, own, certainty, unit=unit)

    def members(self) -> NDArray[np.bool_] | str:
        """Return which labels belong to the set of each trial, shape (trials, classes), or why there are no sets."""
        inside = np.zeros(self.answers.scores.shape, dtype=np.bool_)
        for test, others in splits(self.folds, self.within):
            calibration = self.calibration(others)
            if isinstance(calibration, str):
                return calibration
            certainty, sets = calibration
            if not sets.thresholds:
                return sets.reason
            inside[test] = sets.members(self.answers.rows(test), certainty)
        return inside

    def set_coverage(self, rate_of: RateOf) -> SetCoverage:
        """Return how often the sets contain the true label.

        The model of a fold does not know the instances that it is tested on. The thresholds do indirectly: the models
        of the other folds were trained on them.
        """
        labels, unit, inside = self.trials.labels, _unit(self.trials), self.members()
        if isinstance(inside, str):
            return SetCoverage(asked=COVERAGE, unit=unit, reason=inside)
        covered = inside[np.arange(len(labels)), self.answers.columns_of(labels)].tolist()
        sizes = inside.sum(axis=1)
        rows_of = {
            name: [i for i, label in enumerate(labels) if label == name] for name in self.answers.classes
        }
        right = np.array(self.answers.right(labels))
        below = [i for row in rows_of.values() if right[row].mean() < COVERAGE for i in row]
        return SetCoverage(
            asked=COVERAGE,
            unit=unit,
            covered=rate_of(covered, None),
            covered_below=rate_of(covered, sorted(below)) if below else None,
            by_label={name: rate_of(covered, row) for name, row in rows_of.items()},
            mean_size=float(sizes.mean()),
            single=rate_of((sizes == 1).tolist(), None),
        )

    def reliability(self, rate_of: RateOf) -> Reliability:
        """Return how well the probabilities, calibrated as a model gives them, agree with the rate."""
        answers, labels = self.answers, self.trials.labels
        probabilities = answers.probabilities.copy()
        for test, others in splits(self.folds, self.within):
            calibration = self.calibration(others)
            if not isinstance(calibration, str):
                probabilities[test] = calibration[0].probabilities(answers.rows(test))
        given = np.nan_to_num(probabilities, nan=0.0)
        truth = np.array(labels)[:, np.newaxis] == np.array(answers.classes)
        right = answers.right(labels)
        curve = _bins(given, right, rate_of)
        return Reliability(
            brier=float(((given - truth) ** 2).sum(axis=1).mean()),
            calibration_error=_calibration_error(curve),
            curve=curve,
            uncalibrated_error=_calibration_error(
                _bins(np.nan_to_num(answers.probabilities, nan=0.0), right, rate_of)
            ),
        )


def _bins(
    probabilities: NDArray[np.float64], right: Sequence[bool], rate_of: RateOf
) -> tuple[ReliabilityBin, ...]:
    top = probabilities.max(axis=1)
    bin_of = np.minimum((top * BINS).astype(np.int64), BINS - 1)
    rows_of = [np.flatnonzero(bin_of == number) for number in np.unique(bin_of).tolist()]
    return tuple(ReliabilityBin(float(top[rows].mean()), rate_of(right, rows.tolist())) for rows in rows_of)


def _calibration_error(curve: Sequence[ReliabilityBin]) -> float:
    trials = sum(point.rate.n for point in curve)
    return sum(point.rate.n / trials * abs(point.probability - point.rate.rate) for point in curve)
