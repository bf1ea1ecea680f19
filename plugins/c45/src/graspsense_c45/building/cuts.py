"""The best cut of a numeric attribute at a node, by a scan over its sorted values."""

from __future__ import annotations

import math
from typing import NamedTuple

from graspsense_c45.arithmetic import LN2, Scale, real_weight, term
from graspsense_c45.arrays import Integers, Numbers
from graspsense_c45.building.nodes import weight_of
from graspsense_c45.criteria import (
    are_apart,
    gain_tolerance,
    has_enough_rows,
    is_better_cut,
    least_numerator,
    least_units,
    min_side_weight,
)


class Run(NamedTuple):
    """The rows of a node that know the value of an attribute, sorted: entries `begin` to `stop` (excluded).

    labels: of each row. counts: the weight of each class in the run. passed: an entry for each class, written here.
    """

    rows: Integers
    values: Numbers
    begin: int
    stop: int
    labels: Integers
    counts: Integers
    passed: Integers


class Limits(NamedTuple):
    """What a cut must reach at a node, in fixed point; see `criteria`.

    enough: whether there can be a cut at all. least_weight: on each side. tolerance, least_numerator: of the numerator
    of the gain.
    """

    enough: bool
    least_weight: int
    tolerance: int
    least_numerator: int


class Cut(NamedTuple):
    """The best cut of a run.

    numerator: of the gain, in fixed point. place: the cut is behind this entry; -1 where there is no admissible cut.
    left: the fixed-point weight up to the cut. n_cuts: the number of admissible cuts.
    """

    numerator: int
    place: int
    left: int
    n_cuts: int


def limits_of(
    n_known: int, known: int, weight: float, n_classes: int, min_objects: float, scale: Scale
) -> Limits:
    """Return the limits for an attribute whose value is known of so many rows with so much fixed-point weight.

    weight: of all rows at the node, in rows.
    """
    known_weight = real_weight(known, scale.weight_bits)
    least_weight = min_side_weight(known_weight, n_classes, min_objects)
    least = least_units(least_weight, scale.weight_bits)
    if known < least + least or not has_enough_rows(n_known, least_weight):
        return Limits(False, least, 0, 0)
    return Limits(
        True,
        least,
        gain_tolerance(weight, scale.term_bits),
        least_numerator(weight, known_weight, scale.term_bits),
    )


def scan_unit(run: Run, terms: Integers, steps: Integers, limits: Limits) -> Cut:
    """Return the best cut of a run whose rows all weigh 1.

    terms: ``x ln x`` of 0, 1, ... rows in fixed point. steps: their differences.
    """
    rows, values, begin, stop, labels, counts, passed = run
    _, least, tolerance, least_numerator = limits
    total = stop - begin
    # The numerator without the terms of the sides: L(T), and the changes by the rows scanned so far.
    inside = terms[total]
    best, place, cut_left, n_cuts = 0, -1, 0, 0
    for k in range(len(passed)):
        passed[k] = 0
    # No cut is admissible among the last rows, because the right side needs them.
    for i in range(begin, stop - least):
        k = labels[rows[i]]
        count = passed[k]
        passed[k] = count + 1
        inside += steps[count] - steps[counts[k] - count - 1]
        left = i + 1 - begin
        if left < least or not are_apart(values[i], values[i + 1]):
            continue
        n_cuts += 1
        numerator = inside - terms[left] - terms[total - left]
        if numerator > best and is_better_cut(numerator, best, tolerance, least_numerator):
            best, place, cut_left = numerator, i, left
    return Cut(best, place, cut_left, n_cuts)


def scan_weighted(run: Run, weights: Integers, terms: Integers, scale: Scale, limits: Limits) -> Cut:
    """Return the best cut of a run whose rows have any fixed-point weights; otherwise as `scan_unit`.

    terms: an entry for each class, written here.
    """
    rows, values, begin, stop, labels, counts, passed = run
    _, least, tolerance, least_numerator = limits
    total = weight_of(counts)
    inside = term(total, scale)
    best, place, cut_left, n_cuts = 0, -1, 0, 0
    left = 0
    for k in range(len(passed)):
        passed[k] = 0
        terms[k] = term(counts[k], scale)
    rough = rough_scale(scale)
    for i in range(begin, stop - 1):
        row = rows[i]
        k, weight = labels[row], weights[row]
        low = passed[k] + weight
        passed[k] = low
        left += weight
        right = total - left
        sides = term(low, scale) + term(counts[k] - low, scale)
        inside += sides - terms[k]
        terms[k] = sides
        if left < least or right < least or not are_apart(values[i], values[i + 1]):
            continue
        n_cuts += 1
        # Most places are no better. A rough logarithm shows that, whose error is far below the tolerance.
        if inside - rough_term(left, rough) - rough_term(right, rough) < best + 0.5 * tolerance:
            continue
        numerator = inside - term(left, scale) - term(right, scale)
        if is_better_cut(numerator, best, tolerance, least_numerator):
            best, place, cut_left = numerator, i, left
    return Cut(best, place, cut_left, n_cuts)


class RoughScale(NamedTuple):
    """The terms in a unit of weight, and the logarithm of the units in a row."""

    terms: float
    ln_units: float


def rough_scale(scale: Scale) -> RoughScale:
    """Return the numbers of `rough_term` for these units."""
    return RoughScale(math.ldexp(1.0, scale.term_bits - scale.weight_bits), scale.weight_bits * LN2)


def rough_term(units: int, scale: RoughScale) -> float:
    """Return the term of the weight of a row or more, to within 1e-12 of that weight, in less time than `term`."""
    return units * scale.terms * (math.log(units) - scale.ln_units)
