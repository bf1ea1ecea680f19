"""Certainty: how often answers that rest on as much were right, among trials that were held out.

An answer rests on a probability, and in a tree on the number of training trials in its leaf (its *support*). A leaf
was chosen for its trials, so that 4 of 4 means less than 57 of 57, by how much only held-out trials tell. They are
divided into classes of support, each with enough of them. Within a class the rate of right answers rises with the
probability (isotonic regression, R. E. Barlow et al., Statistical Inference under Order Restrictions, 1972). Each step
of it has enough units. The rates are drawn towards guessing, by what chance spreads their mean, and each is (right + 1)
/ (all + 2), so that no answer is certain. Its 95 % interval is that of a beta distribution with this mean: from few
units a rate is known as badly as that, whatever the luck of these trials. Answers of a cross-validation count for less
than others: its models share training trials, so that the answers of all of them are lucky together. Answers of one
unit, such as grasps of an object, count as one, or as more where units differ little (the design effect of L.
Kish, Survey Sampling, 1965).

Where labels are not equally frequent, answers with a rare one are right less often than others that are as probable. So
a rate is multiplied by how often the answers with its label were right, as a share of what their rates promise. Where
they were right more often than that, it is the wrong ones that are divided, so that no answer becomes certain. Of few
answers that share is partly luck: it is drawn towards that of all labels as rare, which is drawn towards a half. Small
leaves of one label may be right more often than those of another: a label has such a share in each class of support,
drawn towards that of all its answers.

The other labels share what remains in proportion to their probabilities. A probability of 0, as trees and nearest
neighbours give it, says that few training trials had the label, and not that it is impossible.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import evolve, frozen

from graspsense.core.learn.answers import Answers
from graspsense.core.learn.stored_values import StoredValues

if TYPE_CHECKING:
    from numpy.typing import NDArray

STEP_UNITS: Final = 30
"""Least number of units from which a rate is computed, if there are as many.

The highest step is the luckiest, and the more so the fewer units it has.
"""
CLASS_UNITS: Final = 60
"""Least number of units in a class of support, if there are as many."""
LABEL_UNITS: Final = 5
"""With fewer units of a label among the answers, it is not known how certain that answer is."""
LABEL_WEIGHT: Final = 7.0
"""Number of independent answers that weigh as much as what is known of a label without its own answers.

The labels whose answers are most often right are the luckiest ones.
"""
CLASS_WEIGHT: Final = 20.0
"""Number of answers that weigh as much as all answers with a label, in its share of a class of support."""
FURTHER_UNITS: Final = 3.0
"""Units whose answers are all alike that count beside those that are known, for the variance between units."""
AS_RARE: Final = 2.0
"""Labels with at most this many times the answers of a label are as rare."""
UNSEEN: Final = 0.005
"""What each other label has besides its probability: a label without a training trial close by is not impossible."""
SUPPORT_BOUNDS: Final = (5.0, 10.0, 20.0, 40.0, 80.0)
"""Numbers of training trials at which a class of support may begin."""
_ROUNDING: Final = 1e-9


@frozen(kw_only=True)
class SupportClass:
    """Answers that rest on at least `least` training trials, and fewer than those of the next class.

    `rates` rise; each holds for probabilities from the number in `probabilities` at its place on, the first for all
    smaller ones too. `units` is the number of units that they were computed from. `intervals` has the 95 % interval of
    each rate; it is empty in a model that was measured before these were kept.
    """

    least: float
    probabilities: tuple[float, ...]
    rates: tuple[float, ...]
    units: float
    intervals: tuple[tuple[float, float], ...] = ()


@frozen(kw_only=True)
class LabelShare:
    """How often answers with a label are right, as a share of what their rates promise.

    A share above 1 is that of the wrong answers that are promised to those that there are. `low` and `high` are the
    ends of its 95 % interval.
    """

    share: float
    low: float
    high: float


_EVERY_LABEL: Final = LabelShare(share=1.0, low=1.0, high=1.0)
"""The share where those of single labels are not known."""


def _applied(rate: float, share: float) -> float:
    """Return the rate of a label with this share, of that of all labels."""
    return 1.0 - (1.0 - rate) / share if share > 1.0 else rate * share


def _share_of(rate: float, promised: float) -> float:
    """Return the share that makes this rate of the promised one."""
    return (1.0 - promised) / (1.0 - rate) if rate > promised else rate / promised


@frozen(kw_only=True)
class Certainty:
    """The rates of right answers by support and probability; the classes of support begin with the smallest.

    `of_label` has a share for each class of support. Labels that were too seldom the answer are not in it: their
    certainty is not known. None is a model that was measured before these were kept. The rates hold for trials that are
    outside of the training trials by no more than `reach` (`learn.novelty`).
    """

    classes: tuple[SupportClass, ...]
    of_label: Mapping[str, tuple[LabelShare, ...]] | None = None
    reach: float = math.inf

    def class_of(self, support: NDArray[np.float64]) -> NDArray[np.int64]:
        """Return the number of the class of support of each answer. NaN is an answer without support."""
        bounds = [support_class.least for support_class in self.classes[1:]]
        numbers = np.searchsorted(np.array(bounds) - _ROUNDING, np.nan_to_num(support, nan=0.0), side="right")
        return np.asarray(numbers, dtype=np.int64)

    def rate(self, answers: Answers) -> NDArray[np.float64]:
        """Return the rate of right answers that are as likely, with the same label; NaN where it is not known."""
        return self.bounds(answers)[:, 1]

    def bounds(self, answers: Answers) -> NDArray[np.float64]:
        """Return the rate of each answer between the ends of its 95 % interval, shape (trials, 3).

        All are NaN where the rate is not known, and the ends where they were not kept.
        """
        result = np.full((len(answers.columns), 3), np.nan)
        numbers, shares = self.class_of(answers.support).tolist(), answers.shares.tolist()
        for i, (k, value, label) in enumerate(zip(numbers, shares, answers.predicted, strict=True)):
            if self.of_label is not None and label not in self.of_label:
                continue
            own = _EVERY_LABEL if self.of_label is None else self.of_label[label][k]
            of_class = self.classes[k]
            step = bisect_right(of_class.probabilities, value + _ROUNDING, lo=1) - 1
            rate = of_class.rates[step]
            result[i, 1] = _applied(rate, own.share)
            if of_class.intervals:
                low, high = of_class.intervals[step]
                result[i, 0] = min(_applied(low, own.share), _applied(rate, own.low))
                result[i, 2] = max(_applied(high, own.share), _applied(rate, own.high))
        return result

    def probabilities(self, answers: Answers) -> NDArray[np.float64]:
        """Return the probabilities of all labels, of which that of the predicted one is its rate."""
        return with_certainty(answers.probabilities, answers.columns, self.rate(answers))

    def to_json(self) -> dict[str, Any]:
        """Return its entries in the file of a model, as values that JSON represents exactly."""
        classes = [
            {
                "support": support_class.least,
                "units": support_class.units,
                "probabilities": list(support_class.probabilities),
                "rates": list(support_class.rates),
                "intervals": [list(interval) for interval in support_class.intervals],
            }
            for support_class in self.classes
        ]
        entries: dict[str, Any] = {"certainty": classes}
        if self.of_label is not None:
            entries["certainty_of_label"] = {
                name: [[own.low, own.share, own.high] for own in of_classes]
                for name, of_classes in self.of_label.items()
            }
        return entries | ({"certainty_reach": self.reach} if math.isfinite(self.reach) else {})


def certainty_from(stored: StoredValues) -> Certainty | None:
    """Return the certainty of a stored model, None if it has none. Raises DataDamaged."""
    if not stored.has("certainty"):
        return None
    classes: list[SupportClass] = []
    for values in stored.tables("certainty"):
        rates = values.numbers("rates", (None,), least=0.0)
        probabilities = values.numbers("probabilities", (len(rates),), least=0.0)
        if not len(rates) or (rates > 1.0).any():
            raise values.refusal("rates", "there is none, or one is above 1")
        if (np.diff(probabilities) <= 0.0).any():
            raise values.refusal("probabilities", "they do not rise")
        intervals = (
            values.numbers("intervals", (len(rates), 2), least=0.0)
            if "intervals" in values and len(values.items("intervals"))
            else np.empty((0, 2))
        )
        if len(intervals) and not ((intervals[:, 0] <= rates) & (rates <= intervals[:, 1])).all():
            raise values.refusal("intervals", "one does not hold its rate")
        least = values.number("support", least=0.0)
        if classes and least <= classes[-1].least:
            raise values.refusal("support", "the classes of support do not rise")
        classes.append(
            SupportClass(
                least=least,
                probabilities=tuple(probabilities.tolist()),
                rates=tuple(rates.tolist()),
                units=values.number("units", least=0.0),
                intervals=tuple((low, high) for low, high in intervals.tolist()),
            )
        )
    return Certainty(
        classes=tuple(classes),
        of_label=(
            _shares_from(stored.table("certainty_of_label"), len(classes))
            if "certainty_of_label" in stored
            else None
        ),
        reach=stored.number("certainty_reach", least=0.0) if "certainty_reach" in stored else math.inf,
    )


def _shares_from(kept: StoredValues, classes: int) -> dict[str, tuple[LabelShare, ...]]:
    """Return the shares of the labels of a stored model. Raises DataDamaged.

    A model that was measured before each class had its own share has one of a label, for all classes.
    """
    shares = {}
    for label in kept:
        own_of_class = any(isinstance(value, list) for value in kept.items(label))
        numbers = kept.numbers(label, (classes, 3) if own_of_class else (3,), least=0.0).reshape(-1, 3)
        if (np.diff(numbers) < 0.0).any():
            raise kept.refusal(label, "its interval does not hold its share")
        of_classes = [LabelShare(share=share, low=low, high=high) for low, share, high in numbers.tolist()]
        shares[label] = tuple(of_classes if own_of_class else of_classes * classes)
    return shares


def certainty_of(
    answers: Answers, right: Sequence[bool], units: Sequence[str], effect: float = 1.0
) -> Certainty:
    """Return the certainty that held-out answers give; at least one.

    The trials of each unit weigh as much. `effect` is by how much the variance of their rates is larger than that of
    independent answers.
    """
    _, unit_of, trials_of_unit = np.unique(np.array(units), return_inverse=True, return_counts=True)
    weights = 1.0 / trials_of_unit[unit_of]
    known, labels = np.nan_to_num(answers.support, nan=0.0), np.array(answers.predicted)
    correct = np.array(right, dtype=np.float64)
    effect *= _alike(np.bincount(unit_of, weights * correct).astype(np.float64))
    guessing = 1.0 / max(len(set(labels.tolist())), 2)
    edges = [0.0, *_begins(known, weights, SUPPORT_BOUNDS, CLASS_UNITS), np.inf]
    classes = []
    for least, end in pairwise(edges):
        rows = (known >= least) & (known < end)
        classes.append(
            _support_class(least, answers.shares[rows], correct[rows], weights[rows], effect, guessing)
        )
    of_all = Certainty(classes=tuple(classes))
    of_label = _shares(
        labels, of_all.class_of(answers.support), correct, of_all.rate(answers), weights / effect, effect
    )
    return evolve(of_all, of_label=of_label)


def _alike(of_unit: NDArray[np.float64]) -> float:
    """Return the variance of the share of right answers between units, over that of units with a single answer.

    It is at most 1, where all answers in a unit are right or all are wrong, and drawn to that as if by further units:
    few units show the variance badly.
    """
    mean, likely = float(of_unit.mean()), (float(of_unit.sum()) + 1.0) / (len(of_unit) + 2.0)
    further = FURTHER_UNITS * likely * (1.0 - likely)
    between = float(((of_unit - mean) ** 2).sum())
    return (between + further) / (len(of_unit) * mean * (1.0 - mean) + further)


def _shares(
    labels: NDArray[np.str_],
    class_of: NDArray[np.int64],
    right: NDArray[np.float64],
    promised: NDArray[np.float64],
    weights: NDArray[np.float64],
    effect: float,
) -> dict[str, tuple[LabelShare, ...]]:
    """Return how often the answers with each label are right, as a share of the rates that they were promised.

    A label has a share in each class of support.
    """
    names, column = np.unique(labels, return_inverse=True)
    shape = (len(names), int(class_of.max()) + 1)
    # Of all labels together, the rates promise enough: what they were drawn towards guessing is no share of a label.
    right = right / max(float((weights * right).sum() / (weights * promised).sum()), 1.0)
    in_class = [
        np.bincount(column * shape[1] + class_of, weights * counts, math.prod(shape)).reshape(shape)
        for counts in (np.ones(len(labels)), right, promised)
    ]
    units, right_in, promised_in = (counts.sum(axis=1) for counts in in_class)
    shares = {}
    for k in np.flatnonzero(units * effect >= LABEL_UNITS - _ROUNDING).tolist():
        as_rare = units <= AS_RARE * units[k]
        usual = 1.0
        if not as_rare.all():
            promised_as_rare = float(promised_in[as_rare].sum())
            usual = (float(right_in[as_rare].sum()) + LABEL_WEIGHT / 2.0) / (promised_as_rare + LABEL_WEIGHT)
        mean = float(promised_in[k] / units[k])
        rate = mean * (right_in[k] + LABEL_WEIGHT * usual) / (promised_in[k] + LABEL_WEIGHT)
        own = _share_with_interval(float(rate), mean, float(units[k]))
        of_classes = zip(*(counts[k].tolist() for counts in in_class), strict=True)
        shares[str(names[k])] = (
            (own,) if shape[1] == 1 else tuple(_share_in_class(own, *counts) for counts in of_classes)
        )
    return shares


def _share_in_class(own: LabelShare, units: float, right: float, promised: float) -> LabelShare:
    """Return the share of a label in a class of support with so many of its answers, drawn towards its `own`."""
    if units <= 0.0:
        return own
    mean = promised / units
    rate = (right + CLASS_WEIGHT * _applied(mean, own.share)) / (units + CLASS_WEIGHT)
    return _share_with_interval(rate, mean, units + CLASS_WEIGHT)


def _share_with_interval(rate: float, promised: float, units: float) -> LabelShare:
    """Return the share that makes this rate, which so many units tell, of the promised one."""
    low, high = map(float, _interval(rate, units))
    low, share, high = (_share_of(end, promised) for end in (min(low, rate), rate, max(high, rate)))
    return LabelShare(share=share, low=low, high=high)


def with_certainty(
    probabilities: NDArray[np.float64], predicted: NDArray[np.int64], certainty: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return probabilities, shape (trials, classes), in which the predicted label has its certainty.

    The other labels share what remains in proportion to their probabilities, each with `UNSEEN` more, as far as none of
    them exceeds the predicted one. NaN marks a label that is not possible; a trial whose certainty is NaN keeps its
    probabilities.
    """
    result = probabilities.copy()
    for i, (k, sure) in enumerate(zip(predicted.tolist(), certainty.tolist(), strict=True)):
        if math.isnan(sure):
            continue
        others = np.flatnonzero(~np.isnan(result[i]))
        others = others[others != k]
        if not len(others):
            continue
        own = max(sure, 1.0 / (len(others) + 1))
        even = (1.0 - own) / len(others)
        likely = result[i, others] + UNSEEN
        shares = (1.0 - own) * likely / likely.sum()
        most = float(shares.max())
        if most > own + _ROUNDING:
            shares = even + (shares - even) * (own - even) / (most - even)
        result[i, others], result[i, k] = shares, own
    return result


def _interval(rate: Any, units: Any) -> list[Any]:
    """Return the ends of the 95 % interval of a rate, or of several, that is known from so many units."""
    from scipy.special import betaincinv

    return [betaincinv(rate * (units + 2.0), (1.0 - rate) * (units + 2.0), end) for end in (0.025, 0.975)]


def _begins(
    values: NDArray[np.float64], weights: NDArray[np.float64], bounds: Sequence[float], least: float
) -> list[float]:
    """Return at which of these rising bounds a new band of values begins, so that each band has this weight."""
    order = np.argsort(values, kind="stable")
    below = np.concatenate([[0.0], np.cumsum(weights[order])])[np.searchsorted(values[order], bounds)]
    begins, banded, total = [], 0.0, float(weights.sum())
    for bound, weight in zip(bounds, below.tolist(), strict=True):
        if min(weight - banded, total - weight) >= least - _ROUNDING:
            begins.append(bound)
            banded = weight
    return begins


def _support_class(
    least: float,
    probability: NDArray[np.float64],
    right: NDArray[np.float64],
    weights: NDArray[np.float64],
    effect: float,
    guessing: float,
) -> SupportClass:
    """Return the class of support that these answers make: the steps of the isotonic regression, with intervals."""
    from scipy.optimize import isotonic_regression

    probability = np.round(probability, 9)
    values = np.unique(probability)
    edges = [float(values[0]), *_begins(probability, weights, values.tolist(), STEP_UNITS)]
    bins = np.searchsorted(edges[1:], probability, side="right")
    all_of, right_of = np.bincount(bins, weights), np.bincount(bins, weights * right)
    rising = isotonic_regression(right_of / all_of, weights=all_of).x
    _, first_of, level_of = np.unique(rising, return_index=True, return_inverse=True)
    # From here on, units are as many as independent ones that tell as much.
    right_in, units = (
        np.asarray(np.bincount(level_of, counts), dtype=np.float64) / effect for counts in (right_of, all_of)
    )
    # Of the distance of the mean from guessing, what has the least squared error if it is as large as it seems.
    right_of_all, all_units = float(right_in.sum()), float(units.sum())
    mean, likely = right_of_all / all_units, (right_of_all + 1.0) / (all_units + 2.0)
    above = all_units * (mean - guessing) ** 2 / (likely * (1.0 - likely))
    drawn = np.maximum(right_in / units - max(mean - guessing, 0.0) / (above + 1.0), guessing)
    # Two answers more, one of them right, leave none certain; they make no guess among several labels surer.
    rates = np.maximum.accumulate(np.minimum((units * drawn + 1.0) / (units + 2.0), drawn))
    return SupportClass(
        least=least,
        probabilities=tuple(edges[number] for number in first_of.tolist()),
        rates=tuple(rates.tolist()),
        units=float(weights.sum()),
        intervals=tuple(zip(*(ends.tolist() for ends in _interval(rates, units)), strict=True)),
    )
