"""The best cut of each numeric attribute at one node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import FixedPoint, Indices, Mask, Reals, SmallLabels
from graspsense_c45.training_set import TrainingSet

NOT_ADMISSIBLE = -(2**62)
"""The numerator of a place at which no cut is admissible."""


class SortedRows(NamedTuple):
    """The rows of a node, sorted by each numeric attribute; every array has the shape attributes x rows.

    values: those that are missing are NaN, and last. weights: in fixed point, 0 where the value is missing.
    """

    values: Reals
    labels: SmallLabels
    weights: FixedPoint


class CutLimits(NamedTuple):
    """What a cut must reach, in fixed point; see `criteria`. Each array has one entry per attribute.

    totals: attributes x classes, the weight that knows the value. least_weight: on each side. least_numerator,
    tolerance: of the numerator of the gain.
    """

    totals: FixedPoint
    least_weight: FixedPoint
    least_numerator: FixedPoint
    tolerance: int


class BestCuts(NamedTuple):
    """The best cut of each attribute.

    numerator: of the gain, in fixed point. place: the cut is behind this entry; -1 where there is no admissible cut.
    left: the fixed-point weight up to the cut. n_cuts: the number of admissible cuts.
    """

    numerator: FixedPoint
    place: Indices
    left: FixedPoint
    n_cuts: Indices


def best_cuts(rows: SortedRows, limits: CutLimits, training: TrainingSet) -> BestCuts:
    """Return the cut that J48's scan along the sorted rows ends on, for each attribute."""
    known = limits.totals.sum(axis=1)
    left = rows.weights.cumsum(axis=1)
    right = known[:, None] - left
    least = limits.least_weight[:, None]
    admissible = (left >= least) & (right >= least)
    admissible[:, -1] = False
    admissible[:, :-1] &= criteria.are_apart(rows.values[:, :-1], rows.values[:, 1:])
    n_cuts = admissible.sum(axis=1)
    place = np.full(len(known), -1)
    best = np.zeros(len(known), dtype=np.int64)
    if n_cuts.any():
        numerators = _numerators(rows, limits.totals, left, training)
        numerators[~admissible] = NOT_ADMISSIBLE
        scan(numerators, limits, best, place)
    return BestCuts(best, place, left[np.arange(len(known)), place], n_cuts)


def scan(numerators: FixedPoint, limits: CutLimits, best: FixedPoint, place: Indices) -> None:
    """Write the best numerator and its place. Only those above all earlier ones are looked at: no other is taken."""
    highest = np.maximum.accumulate(numerators, axis=1)
    record = numerators > NOT_ADMISSIBLE
    record[:, 1:] &= highest[:, 1:] > highest[:, :-1]
    least, tolerance = limits.least_numerator.tolist(), limits.tolerance
    attributes, places = record.nonzero()
    for a, i, numerator in zip(
        attributes.tolist(), places.tolist(), numerators[attributes, places].tolist(), strict=True
    ):
        if criteria.is_better_cut(numerator, int(best[a]), tolerance, least[a]):
            best[a], place[a] = numerator, i


def _numerators(rows: SortedRows, totals: FixedPoint, left: FixedPoint, training: TrainingSet) -> FixedPoint:
    """Return the numerator of the gain of a cut behind each entry (see `criteria.gain`), admissible or not."""
    each, known = np.arange(len(totals))[:, None], left[:, -1:]
    by_class = rows.labels.argsort(axis=1, kind="stable")
    labels = rows.labels[each, by_class]
    passed = rows.weights[each, by_class].cumsum(axis=1) - (totals.cumsum(axis=1) - totals)[each, labels]
    # All in one call, since most nodes are small.
    given = (passed, totals[each, labels] - passed, left, known - left, totals, known)
    terms = training.terms(np.concatenate([weights.ravel() for weights in given]))
    ends = np.cumsum([weights.size for weights in given])
    of_passed, of_others, of_left, of_right, of_totals, of_known = (
        part.reshape(weights.shape) for part, weights in zip(np.split(terms, ends[:-1]), given, strict=True)
    )
    # What moving each row from right to left changes in the sum of x ln x over classes and sides.
    of_class = of_passed + of_others
    change = of_class.copy()
    change[:, 1:] -= of_class[:, :-1]
    begins_class = _first_of_class(labels)
    change[begins_class] = (of_class - of_totals[each, labels])[begins_class]
    steps = np.empty_like(change)
    steps[each, by_class] = change
    numerators: FixedPoint = steps.cumsum(axis=1) - of_left - of_right + of_known
    return numerators


def _first_of_class(labels: SmallLabels) -> Mask:
    begins_class = np.ones(labels.shape, dtype=np.bool_)
    begins_class[:, 1:] = labels[:, 1:] != labels[:, :-1]
    return begins_class
