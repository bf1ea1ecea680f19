"""Classifiers and feature sets crossed on the same folds: which are as good as the best, and which is cheapest.

Every candidate is compared with the one that has the highest rate, paired by trial, with intervals corrected for the
number of comparisons (Bonferroni).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Final, Literal

import numpy as np
from attrs import frozen

from graspsense.core.errors import ConfigError
from graspsense.evaluation.crossval import ClassifierFactory, FitRefused, cross_validate
from graspsense.evaluation.doubt import exchangeable_instances
from graspsense.evaluation.folds import in_order, instance_held_out, stratified
from graspsense.evaluation.intervals import Difference, RecognitionRate, difference, rate_of

if TYPE_CHECKING:
    from graspsense.core.features import FeatureTable
    from graspsense.core.labelled import Labelled
    from graspsense.evaluation.folds import Folds

MARGIN: Final = 0.02
"""Largest loss of rate with which a candidate counts as equivalent to the best."""
BEFORE_CONTACT: Final = "before_contact"

Standing = Literal["best", "equivalent", "undecided", "worse", "control"]


@frozen(kw_only=True)
class Candidate:
    """A classifier with a feature set.

    `rates` has the rate under each protocol. `training_s` is the mean time of a fit. `loss` is the rate of the best
    minus this rate, under the first protocol. The candidate is `equivalent` if the interval of the loss is below
    2 points, `worse` if it is above zero, else `undecided`: more trials could show either. Features from before the
    contact are a `control`, which is not compared.
    """

    classifier: str
    features: str
    rates: Mapping[str, RecognitionRate]
    training_s: float
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

    @property
    def verdict(self) -> str:
        """The best, those that are equivalent to it, and the cheapest of these, in words."""
        best = self.candidates[0]
        rate = 100 * best.rates[self.protocol].rate
        equal = [one for one in self.candidates if one.standing in ("best", "equivalent")]
        open_ = [one for one in self.candidates if one.standing == "undecided"]
        text = f"{best.name} has the highest rate, {rate:.1f} %."
        if len(equal) > 1:
            cheapest = min(equal, key=lambda one: one.training_s)
            others = ", ".join(one.name for one in equal[1:])
            text += f" Equivalent within {100 * MARGIN:.0f} points: {others}. The cheapest to train is {cheapest.name}."
        else:
            text += f" None is shown to be equivalent within {100 * MARGIN:.0f} points."
        if open_:
            cheapest = min((best, *open_), key=lambda one: one.training_s)
            text += (
                f" {len(open_)} more are undecided. Of these and the best, {cheapest.name} is the cheapest."
            )
        controls = [one for one in self.candidates if one.standing == "control"]
        if controls:
            early = max(controls, key=lambda one: one.rates[self.protocol].rate)
            share = 100 * early.rates[self.protocol].rate
            text += f" From before the contact alone, {early.classifier} recognises {share:.1f} %."
        return text


def rank(
    learners: Mapping[str, ClassifierFactory],
    trials: Mapping[str, Labelled],
    *,
    folds: int = 10,
    seed: int = 0,
    progress: Callable[[str, int, int], None] | None = None,
) -> Ranking:
    """Cross-validate every classifier with every feature set, on the same folds.

    `trials` are the same trials with different features. Raises ConfigError if they differ in labels, or if no
    candidate can be measured.
    """
    first = next(iter(trials.values()))
    for name, one in trials.items():
        if (one.labels, one.instances) != (first.labels, first.instances):
            raise ConfigError(
                f"the trials with the features {name!r} are not those with {next(iter(trials))!r}"
            )
    protocols = _protocols(first, folds, seed)
    headline = next(iter(protocols))
    tables: list[tuple[str, str, str, FeatureTable, Folds]] = [
        (learner, name, protocol, one.table, of)
        for learner in learners
        for name, one in trials.items()
        for protocol, of in protocols.items()
    ]
    if first.before_contact is not None:
        before = first.before_contact.table
        tables += [(one, BEFORE_CONTACT, headline, before, protocols[headline]) for one in learners]
    right: dict[tuple[str, str], dict[str, list[bool]]] = {}
    seconds: dict[tuple[str, str], float] = {}
    notes = []
    for done, (learner, name, protocol, table, of) in enumerate(tables):
        if progress is not None:
            progress(f"{learner} with {name}", done, len(tables))
        began = time.perf_counter()
        try:
            pooled = cross_validate(
                learners[learner], table, first.labels, [np.arange(len(first))], [of], seed=seed
            )
        except FitRefused as refusal:
            notes.append(f"{learner} with {name}, {protocol}: {refusal}")
            continue
        right.setdefault((learner, name), {})[protocol] = pooled.right(first.labels)
        seconds.setdefault((learner, name), (time.perf_counter() - began) / (int(of.max()) + 1))
    return Ranking(
        source=first.source,
        protocol=headline,
        trials=len(first),
        candidates=_ranked(right, seconds, headline, first),
        notes=(*first.notes, *notes),
    )


def _protocols(trials: Labelled, k: int, seed: int) -> dict[str, Folds]:
    """Return the folds of each protocol that these trials allow, that of the comparison first."""
    protocols: dict[str, Folds] = {}
    instances = exchangeable_instances(trials)
    if instances is not None:
        protocols["instance_held_out"] = instance_held_out(trials.labels, instances, k, seed)
    protocols[f"stratified_{k}_fold"] = stratified(trials.labels, k, seed)
    if trials.order is not None:
        protocols["recording_order"] = in_order(trials.labels, trials.order, k)
    return protocols


def _ranked(
    right: Mapping[tuple[str, str], Mapping[str, list[bool]]],
    seconds: Mapping[tuple[str, str], float],
    headline: str,
    trials: Labelled,
) -> tuple[Candidate, ...]:
    """Return the candidates that were measured under the headline protocol; those from before contact come last."""
    measured = [key for key in right if headline in right[key]]
    judged = [key for key in measured if key[1] != BEFORE_CONTACT]
    if not judged:
        raise ConfigError("no classifier could be trained on these trials")
    best = max(judged, key=lambda key: sum(right[key][headline]))
    comparisons = max(len(judged) - 1, 1)
    candidates = []
    for key in sorted(
        measured, key=lambda key: (key[1] == BEFORE_CONTACT, -sum(right[key][headline]), key != best)
    ):
        loss = None
        standing: Standing = "best" if key == best else "control"
        if key != best and key in judged:
            loss = difference(right[best][headline], right[key][headline], trials.instances, comparisons)
            standing = _standing(loss)
        candidates.append(
            Candidate(
                classifier=key[0],
                features=key[1],
                rates={
                    protocol: rate_of(of, trials.instances, trials.no_interval)
                    for protocol, of in right[key].items()
                },
                training_s=seconds[key],
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
