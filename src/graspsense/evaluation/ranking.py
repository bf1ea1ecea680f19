"""Classifiers and feature sets crossed on the same folds: which are as good as the best, and which is cheapest.

Every candidate is compared with the one that has the highest rate, paired by trial, with intervals that hold together
for all pairs; the rate of that one is corrected for the choice (`graspsense.evaluation.chosen`). A classifier outside
of graspsense can be compared too, if it predicts the same trials with the same folds (`OutsideAnswers`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Final, Literal

import numpy as np
from attrs import evolve, frozen

from graspsense.core.learn.conformal import exchangeable_instances
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import ConfigError
from graspsense.core.values.features import FeatureTable
from graspsense.evaluation.chosen import ChosenRate, comparisons_of, rate_of_chosen
from graspsense.evaluation.crossval import ClassifierFactory, FitRefused, cross_validate
from graspsense.evaluation.doubt import HeldOut, SetCoverage
from graspsense.evaluation.evaluate import notes_on
from graspsense.evaluation.folds import (
    Folds,
    commonest,
    held_out_protocol,
    in_order,
    instance_held_out,
    stratified,
)
from graspsense.evaluation.gathered_warnings import gathered_warnings
from graspsense.evaluation.intervals import Difference, RecognitionRate, difference, rate_among, rate_of
from graspsense.evaluation.over_seeds import MARGIN

BEFORE_CONTACT: Final = "before_contact"

Standing = Literal["best", "equivalent", "undecided", "worse", "control"]


@frozen(kw_only=True)
class Candidate:
    """A classifier with a feature set.

    `rates` has the rate under each protocol. `training_s` is the mean time of a fit. `sets` is the coverage of the
    prediction sets under the first protocol, None for a control or an answer from outside. `loss` is the rate of the
    best minus this rate, under the first protocol. The candidate is `equivalent` if the interval of the loss is below
    2 points, `worse` if it is above zero, else `undecided`: more trials could show either. Features from before the
    contact are a `control`, which is not compared.
    """

    classifier: str
    features: str
    rates: Mapping[str, RecognitionRate]
    training_s: float
    sets: SetCoverage | None
    loss: Difference | None
    standing: Standing

    @property
    def name(self) -> str:
        """The classifier with its features."""
        return f"{self.classifier} with {self.features}"


@frozen(kw_only=True)
class Ranking:
    """The candidates by their rate, the best first; those that were refused, with the reason, are in `notes`."""

    source: str
    protocol: str
    trials: int
    candidates: tuple[Candidate, ...]
    notes: tuple[str, ...]
    chosen: ChosenRate | None = None
    """The rate of the best without the luck of being chosen; None for a single candidate."""
    guessing: float = 0.0
    """The rate of always giving the most frequent label."""

    @property
    def verdict(self) -> str:
        """The best, those that are equivalent to it, and the cheapest of these, in words."""
        best = self.candidates[0]
        rate = 100 * best.rates[self.protocol].rate
        alone = len(self.candidates) == 1
        text = f"{best.name} {'recognises' if alone else 'has the highest rate,'} {rate:.1f} %."
        if self.chosen is not None:
            chosen = self.chosen
            text += f" The best of {chosen.candidates} owes something to luck: expect {chosen.words} of new trials."
        interval = best.rates[self.protocol].interval
        if interval is None or interval[0] <= self.guessing:
            guessing = f"always giving the most frequent label ({100 * self.guessing:.1f} %)"
            text += f" It is not shown to be better than {guessing}."
        text += "" if alone else f" {self.equals}"
        controls = [candidate for candidate in self.candidates if candidate.standing == "control"]
        if controls:
            early = max(controls, key=lambda control: control.rates[self.protocol].rate)
            share = 100 * early.rates[self.protocol].rate
            text += f" From before the contact alone, {early.classifier} recognises {share:.1f} %."
        return text

    @property
    def equals(self) -> str:
        """Those that are equivalent to the best or undecided, and the cheapest of them, in words."""
        best = self.candidates[0]
        equal = [candidate for candidate in self.candidates if candidate.standing in ("best", "equivalent")]
        open_ = [candidate for candidate in self.candidates if candidate.standing == "undecided"]
        if len(equal) > 1:
            cheapest = min(equal, key=lambda candidate: candidate.training_s)
            others = ", ".join(candidate.name for candidate in equal[1:])
            text = f"Equivalent within {100 * MARGIN:.0f} points: {others}. The cheapest to train is {cheapest.name}."
        else:
            text = f"None is shown to be equivalent within {100 * MARGIN:.0f} points."
        if open_:
            cheapest = min((best, *open_), key=lambda candidate: candidate.training_s)
            verb = "is" if len(open_) == 1 else "are"
            text += f" {len(open_)} more {verb} undecided. Of these and the best, {cheapest.name} is the cheapest."
        return text


@frozen(kw_only=True)
class OutsideAnswers:
    """The labels that a classifier outside of graspsense predicts for all trials, under each of `protocols_of`.

    `training_s` is the mean time of a fit.
    """

    predicted: Mapping[str, Sequence[str]]
    training_s: float


@frozen(kw_only=True)
class CandidateResult:
    """What is known of a classifier with a feature set: which trials are right under each protocol, and the sets."""

    right: Mapping[str, list[bool]]
    training_s: float
    sets: SetCoverage | None = None


def rank(
    learners: Mapping[str, ClassifierFactory],
    trials: Mapping[str, Labelled],
    *,
    folds: int = 10,
    seed: int = 0,
    protocols: Mapping[str, Folds] | None = None,
    outside: Mapping[tuple[str, str], OutsideAnswers] | None = None,
    progress: Callable[[str, int, int], None] | None = None,
) -> Ranking:
    """Cross-validate every classifier with every feature set, on the same folds.

    `trials` are the same trials with different features. `protocols` are some of `protocols_of`, which are used
    otherwise; the candidates are compared under the first. `outside` has further answers by the name of the classifier
    and of its features. Raises ConfigError if the trials differ in labels, or if no candidate can be measured.
    """
    reference = next(iter(trials.values()))
    for name, trial in trials.items():
        if (trial.labels, trial.instances) != (reference.labels, reference.instances):
            raise ConfigError(
                f"the trials with the features {name!r} are not those with {next(iter(trials))!r}"
            )
    protocols = protocols or protocols_of(reference, folds, seed)
    headline = next(iter(protocols))
    tables = {name: trial.table for name, trial in trials.items()}
    if reference.before_contact is not None:
        tables[BEFORE_CONTACT] = reference.before_contact.table
    measured: dict[tuple[str, str], CandidateResult] = {}
    notes: list[str] = []
    pairs = [(learner, name) for name in tables for learner in learners]
    for done, (learner, name) in enumerate(pairs):
        if progress is not None:
            progress(f"{learner} with {name}", done, len(pairs))
        wanted = {headline: protocols[headline]} if name == BEFORE_CONTACT else protocols
        try:
            with gathered_warnings(notes):
                measured[learner, name] = _measured(learners[learner], tables[name], reference, wanted, seed)
        except FitRefused as refusal:
            notes.append(f"{learner} with {name}: {refusal}")
    for key, answers in (outside or {}).items():
        right = {
            protocol: [a == b for a, b in zip(predicted, reference.labels, strict=True)]
            for protocol, predicted in answers.predicted.items()
        }
        measured[key] = CandidateResult(right=right, training_s=answers.training_s)
    told = (*reference.notes, *notes_on(reference, folds), *dict.fromkeys(notes))
    return ranking_of(measured, headline, reference, told, folds)


def ranking_of(
    measured: Mapping[tuple[str, str], CandidateResult],
    headline: str,
    trials: Labelled,
    notes: Sequence[str],
    folds: int,
    chosen: ChosenRate | None = None,
) -> Ranking:
    """Return the candidates of these trials, by the names of classifier and features, under the protocol `headline`.

    `folds` is the number of folds. `chosen` is the rate of the best without the luck of the choice; by default it is
    estimated from these answers. Raises ConfigError without a candidate.
    """
    judged = [key for key in measured if key[1] != BEFORE_CONTACT]
    if not judged:
        raise no_candidate(notes)
    right_of = np.array([measured[key].right[headline] for key in judged])
    if chosen is None and len(judged) > 1:
        chosen = rate_of_chosen(right_of, trials.instances, trials.no_interval, folds)
    return Ranking(
        source=trials.source,
        protocol=headline,
        trials=len(trials),
        candidates=_ranked(
            measured, headline, trials, folds, chosen, comparisons_of(right_of, trials.instances)
        ),
        notes=tuple(notes),
        chosen=chosen,
        guessing=trials.labels.count(commonest(trials.labels)) / len(trials),
    )


def no_candidate(notes: Sequence[str]) -> ConfigError:
    """Return the error that no classifier could be trained, with the reasons in `notes`."""
    return ConfigError(
        "no classifier could be trained on these trials" + "".join(f"\n{note}" for note in notes)
    )


def protocols_of(trials: Labelled, k: int, seed: int) -> dict[str, Folds]:
    """Return the folds of each protocol that these trials allow, that of the comparison first."""
    protocols: dict[str, Folds] = {}
    instances = exchangeable_instances(trials)
    if instances is not None:
        protocols[held_out_protocol(trials)] = instance_held_out(trials.labels, instances, k, seed)
    protocols[f"stratified_{k}_fold"] = stratified(trials.labels, k, seed)
    if trials.order is not None:
        protocols["recording_order"] = in_order(trials.labels, trials.order, k)
    return protocols


def _measured(
    learner: ClassifierFactory,
    table: FeatureTable,
    trials: Labelled,
    protocols: Mapping[str, Folds],
    seed: int,
) -> CandidateResult:
    """Return the answers of a classifier under each protocol. Raises FitRefused."""
    right, seconds, sets = {}, [], None
    for protocol, folds in protocols.items():
        began = time.perf_counter()
        answers = cross_validate(learner, table, trials.labels, folds, seed=seed)
        seconds.append((time.perf_counter() - began) / (int(folds.max()) + 1))
        right[protocol] = answers.right(trials.labels)
        if sets is None:
            rate_of_trials = partial(rate_among, trials, folds=int(folds.max()) + 1)
            sets = HeldOut(answers=answers, trials=trials, folds=folds).set_coverage(rate_of_trials)
    return CandidateResult(right=right, training_s=seconds[0], sets=sets)


def _ranked(
    measured: Mapping[tuple[str, str], CandidateResult],
    headline: str,
    trials: Labelled,
    folds: int,
    chosen: ChosenRate | None,
    comparisons: float,
) -> tuple[Candidate, ...]:
    """Return the candidates by their rate under the headline protocol; those from before contact come last."""
    judged = [key for key in measured if key[1] != BEFORE_CONTACT]
    right = {key: result.right[headline] for key, result in measured.items()}
    best = max(judged, key=lambda key: sum(right[key]))
    candidates = []
    for key in sorted(right, key=lambda key: (key[1] == BEFORE_CONTACT, -sum(right[key]), key != best)):
        loss = None
        standing: Standing = "best" if key == best else "control"
        if key != best and key in judged:
            loss = difference(right[best], right[key], trials.instances, comparisons, folds=folds)
            standing = _standing(loss)
        measured_key = measured[key]
        rates = {
            protocol: rate_of(answers, trials.instances, trials.no_interval, folds=folds)
            for protocol, answers in measured_key.right.items()
        }
        if key == best and chosen is not None:
            rates[headline] = evolve(rates[headline], interval=chosen.interval)
        candidates.append(
            Candidate(
                classifier=key[0],
                features=key[1],
                rates=rates,
                training_s=measured_key.training_s,
                sets=measured_key.sets if key in judged else None,
                loss=loss,
                standing=standing,
            )
        )
    return tuple(candidates)


def _standing(loss: Difference) -> Standing:
    if loss.interval is None:
        return "undecided"
    low, high = loss.interval
    if high < MARGIN:
        return "equivalent"
    return "worse" if low > 0.0 else "undecided"
