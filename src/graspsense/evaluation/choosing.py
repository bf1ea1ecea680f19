"""Choosing a classifier with its features, and the rate of the whole procedure (nested cross-validation).

The folds are those of a comparison. For each outer fold, the choice is made among the other folds: each of them is
predicted by models of the remaining ones, and the candidate with the most right answers predicts the outer fold. So no
trial takes part in the choice that it is predicted by, and the rate over all outer folds is not raised by the choice.
A model without the folds i and j serves both the choice for i and that for j. The choice that is used in the end is
made in the same way, among all folds.

The certainty of the chosen model comes from the same answers of the outer folds. Its own cross-validated answers are
too good: among candidates that know nothing, the chosen one had the most luck on these very trials.
"""

from __future__ import annotations

import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import FAILURES, ConfigError, counted, named
from graspsense.evaluation.chosen import ChosenRate
from graspsense.evaluation.crossval import ClassifierFactory, cross_validate, fit_and_predict
from graspsense.evaluation.folds import INSTANCE_HELD_OUT, Folds
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.intervals import RecognitionRate, rate_of
from graspsense.evaluation.ranking import (
    Candidate,
    CandidateResult,
    Ranking,
    no_candidate,
    protocols_of,
    ranking_of,
)

FOLDS: Final = 5
LEAST_FOLDS: Final = 3
"""One fold is predicted, one decides the choice, and one is learned from."""


@frozen(kw_only=True)
class ChosenPipeline:
    """The candidate that was chosen, and what its choice is worth.

    `rate` is that of the whole procedure: choice and training on trials that are not predicted. `answers` are those of
    the procedure, `right` says which of them are correct. `chosen_in` counts in how many outer folds each candidate was
    chosen. `ranking` compares all candidates; the first is the chosen one.
    """

    rate: RecognitionRate
    answers: Answers
    right: tuple[bool, ...]
    chosen_in: Mapping[str, int]
    ranking: Ranking

    @property
    def best(self) -> Candidate:
        """The chosen candidate."""
        return self.ranking.candidates[0]


@frozen(kw_only=True, eq=False)
class _Answers:
    """What a candidate answers.

    `inner` has shape (folds, trials): the row of a fold says which trials are recognised by models that know neither
    this fold nor that of the trial. `outer` are the answers of models that only do not know the fold of the trial.
    """

    inner: NDArray[np.bool_]
    outer: Answers
    training_s: float


def choose(
    learners: Mapping[str, ClassifierFactory],
    trials: Mapping[str, Labelled],
    pairs: Sequence[tuple[str, str]] | None = None,
    *,
    seed: int = 0,
    notes: Sequence[str] = (),
    progress: Callable[[str, int, int], None] | None = None,
) -> ChosenPipeline:
    """Choose one of the classifiers with one of the feature sets.

    `trials` are the same trials with different features. `pairs` are the candidates by the names of classifier and
    features; by default, these are all. Of candidates with equal rates the first is chosen, in this order. A candidate
    that fails is left out, with a note after `notes`. Raises ConfigError if nothing can be chosen from these trials.
    """
    known = next(iter(trials.values()))
    protocol, folds = _folds(known, seed)
    notes = [*dict.fromkeys(note for trial in trials.values() for note in trial.notes), *notes]
    if protocol != INSTANCE_HELD_OUT:
        why = known.no_instances or "too many labels have a single instance"
        notes.append(f"{why}: whole objects cannot be held out, so the rate is that for these objects")
    pairs = pairs or [(learner, name) for name in trials for learner in learners]
    answers: dict[tuple[str, str], _Answers] = {}
    with gathered_warnings(notes):
        for done, (learner, name) in enumerate(pairs):
            if progress is not None:
                progress(f"{learner} with {name}", done, len(pairs))
            try:
                answers[learner, name] = _answers(learners[learner], trials[name], folds, seed)
            except FAILURES as error:
                notes.append(f"{learner} with {name} is left out: {named(error)}")
    if not answers:
        raise no_candidate(tuple(dict.fromkeys(notes)))
    nested, chosen_in = _nested(answers, folds)
    right = nested.right(known.labels)
    # It is the rate of any of the candidates that a fold chose: where these differ, one of them may have been lucky.
    rate = rate_of(right, known.instances, known.no_interval, float(len(chosen_in)), folds=FOLDS)
    ranking = ranking_of(
        {
            key: CandidateResult(
                right={protocol: answer.outer.right(known.labels)}, training_s=answer.training_s
            )
            for key, answer in answers.items()
        },
        protocol,
        known,
        tuple(dict.fromkeys(notes)),
        FOLDS,
        ChosenRate(rate=rate.rate, interval=rate.interval, of=len(answers)),
    )
    return ChosenPipeline(rate=rate, answers=nested, right=tuple(right), chosen_in=chosen_in, ranking=ranking)


def _folds(trials: Labelled, seed: int) -> tuple[str, Folds]:
    """Return the protocol of a comparison of these trials, and its folds. Raises ConfigError if they are too few."""
    if len(trials.classes) < 2:
        raise ConfigError(
            f"every trial of {trials.source} has the label {trials.labels[0]!r}: there is nothing to choose by"
        )
    if len(trials) < FOLDS:
        raise ConfigError(
            f"{counted(len(trials), 'trial is', 'trials are')} too few to choose by: record at least {FOLDS}"
        )
    protocol, folds = next(iter(protocols_of(trials, FOLDS, seed).items()))
    if int(folds.max()) + 1 < LEAST_FOLDS:
        raise ConfigError(
            f"{counted(int(folds.max()) + 1, 'instance is', 'instances are')} too few to choose by: record at "
            f"least {LEAST_FOLDS}"
        )
    return protocol, folds


def _nested(answers: Mapping[tuple[str, str], _Answers], folds: Folds) -> tuple[Answers, dict[str, int]]:
    """Return the answers of the procedure, and how often it chose each candidate.

    Support counts only where every answer is by the same candidate: of others, it is the support of something else.
    """
    chosen = [
        max(answers, key=lambda key: int(answers[key].inner[fold].sum()))
        for fold in range(int(folds.max()) + 1)
    ]
    outer = [answers[key].outer for key in chosen]
    rows = np.arange(len(folds))
    alike = len(set(chosen)) == 1
    nested = evolve(
        outer[0],
        columns=np.array([of_fold.columns for of_fold in outer])[folds, rows],
        probabilities=np.array([of_fold.probabilities for of_fold in outer])[folds, rows],
        scores=np.array([of_fold.scores for of_fold in outer])[folds, rows],
        support=outer[0].support if alike else np.full(len(folds), np.nan),
        outside=np.array([of_fold.outside for of_fold in outer])[folds, rows],
    )
    return nested, dict(Counter(" with ".join(key) for key in chosen).most_common())


def _answers(learner: ClassifierFactory, trials: Labelled, folds: Folds, seed: int) -> _Answers:
    """Return the answers of a candidate. Raises what its classifier raises."""
    count, labels = int(folds.max()) + 1, np.array(trials.labels)
    inner = np.zeros((count, len(folds)), dtype=np.bool_)
    began = time.perf_counter()
    outer = cross_validate(learner, trials.table, trials.labels, folds, seed=seed)
    training_s = (time.perf_counter() - began) / count
    for fold, other in combinations(range(count), 2):
        away = (folds == fold) | (folds == other)
        test, training = np.flatnonzero(away), np.flatnonzero(~away)
        known = labels[training].tolist()
        classes, shares, _ = fit_and_predict(learner, trials.table, training, known, test, seed)
        right = np.array(classes)[shares.argmax(axis=1)] == labels[test]
        inner[fold, test] |= right & (folds[test] == other)
        inner[other, test] |= right & (folds[test] == fold)
    return _Answers(inner=inner, outer=outer, training_s=training_s)
