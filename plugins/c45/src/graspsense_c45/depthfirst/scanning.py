"""The best cut of one attribute at one node, by a scan over its sorted rows.

`nodewise.cuts` finds the same cut with whole arrays; `tests/test_engines.py` compares the two.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import Scale, term
from graspsense_c45.arrays import FixedPoint, Integer, Reals, SmallLabels
from graspsense_c45.criteria import are_apart, is_better_cut
from graspsense_c45.depthfirst.nodes import RowIndices, weight_of


class Run(NamedTuple):
    """The rows of a node, sorted by the values of an attribute: entries `begin` to `stop` (excluded) of the arrays."""

    rows: RowIndices
    values: Reals
    labels: SmallLabels
    begin: Integer
    stop: Integer


class Limits(NamedTuple):
    """What a cut must reach at a node, in fixed point; see `criteria`.

    least_weight: on each side. tolerance, least_numerator: of the numerator of the gain.
    """

    least_weight: Integer
    tolerance: Integer
    least_numerator: Integer


class Cut(NamedTuple):
    """The best cut of a run.

    numerator: of the gain, in fixed point. place: the cut is behind this entry; -1 where there is no admissible cut.
    left: the fixed-point weight up to the cut. n_cuts: the number of admissible cuts.
    """

    numerator: Integer
    place: Integer
    left: Integer
    n_cuts: Integer


def scan_unit(
    run: Run, counts: FixedPoint, passed: FixedPoint, terms: FixedPoint, steps: FixedPoint, limits: Limits
) -> Cut:
    """Return the best cut of a node whose rows all weigh 1.

    counts: rows of each class at the node. passed: zeros, one per class. terms: ``x ln x`` of 0, 1, ... rows, in fixed
    point; steps: their differences.
    """
    rows, values, labels, begin, stop = run
    total = stop - begin
    # The numerator without the terms of the sides: L(T), and the changes by the rows scanned so far.
    inside = terms[total]
    best: Integer = np.int64(0)
    cut_left: Integer = np.int64(0)
    place: Integer = np.int64(-1)
    n_cuts = 0
    # No cut is admissible among the last rows, because the right side needs them.
    for i in range(begin, stop - limits.least_weight):
        k = labels[rows[i]]
        count = passed[k]
        passed[k] = count + 1
        inside += steps[count] - steps[counts[k] - count - 1]
        left = i + 1 - begin
        if left < limits.least_weight or not are_apart(values[i], values[i + 1]):
            continue
        n_cuts += 1
        numerator = inside - terms[left] - terms[total - left]
        if is_better_cut(numerator, best, limits.tolerance, limits.least_numerator):
            best, place, cut_left = numerator, i, left
    return Cut(best, place, cut_left, n_cuts)


def scan_weighted(
    run: Run, counts: FixedPoint, passed: FixedPoint, weights: FixedPoint, scale: Scale, limits: Limits
) -> Cut:
    """Return the best cut of a node whose rows have any fixed-point weights; otherwise as `scan_unit`."""
    rows, values, labels, begin, stop = run
    total = weight_of(counts)
    inside = term(total, scale)
    best: Integer = np.int64(0)
    cut_left: Integer = np.int64(0)
    place: Integer = np.int64(-1)
    n_cuts = 0
    left = np.int64(0)
    for i in range(begin, stop - 1):
        row = rows[i]
        k, weight = labels[row], weights[row]
        low = passed[k]
        high = counts[k] - low
        passed[k] = low + weight
        left += weight
        right = total - left
        inside += term(low + weight, scale) - term(low, scale)
        inside += term(high - weight, scale) - term(high, scale)
        if left < limits.least_weight or right < limits.least_weight:
            continue
        if not are_apart(values[i], values[i + 1]):
            continue
        n_cuts += 1
        numerator = inside - term(left, scale) - term(right, scale)
        if is_better_cut(numerator, best, limits.tolerance, limits.least_numerator):
            best, place, cut_left = numerator, i, left
    return Cut(best, place, cut_left, n_cuts)
