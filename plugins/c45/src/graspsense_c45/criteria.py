"""The rules by which C4.5 splits and prunes: gain, gain ratio, least weights, tolerances.

W is the weight at a node, T the weight of its rows that know the value of the attribute, and L(x) = x ln x. Gains are
in bits.

Source: Quinlan, C4.5: Programs for Machine Learning (1993), sections 2.2 to 2.4 (gain, gain ratio, tests on numbers)
and 4 (pruning); Quinlan, Improved use of continuous attributes in C4.5, JAIR 4 (1996) (the cost of a threshold). The
tolerances are those of weka.classifiers.trees.j48 3.9.6, in the class that each docstring names.
"""

from __future__ import annotations

import math

from graspsense_c45.arithmetic import LN2, TOLERANCE, Scale, ln, real_term, real_weight
from graspsense_c45.arrays import Numbers, Truths

GAP = 1e-5
"""A cut lies between neighbouring values that differ by more than this, in the unit of the attribute (C45Split)."""

AVERAGE_SLACK = 1e-3
"""An attribute is eligible where its gain is at least the average gain less this, in bits (C45ModelSelection)."""

MANY_VALUES = 0.3
"""A nominal attribute with this ratio of values to rows, or a larger one, is left out of the average gain."""

COLLAPSE_SLACK = 1e-3
"""Training errors that a subtree may save without being kept (C45PruneableClassifierTree.collapse)."""
PRUNING_SLACK = 0.1
"""Estimated errors by which a smaller tree may be worse (C45PruneableClassifierTree.prune)."""


# ---------------------------------------------------------------------------------------------- which nodes split


def is_pure_or_small(weight: float, majority_weight: float, min_objects: float) -> bool:
    """Return whether a node is a leaf: below twice the least weight, or of one class (C45ModelSelection)."""
    return 2.0 * min_objects - weight > TOLERANCE or weight - majority_weight < TOLERANCE


def min_side_weight(known_weight: float, n_classes: int, min_objects: float) -> float:
    """Return the least weight of each side of a numeric test: a tenth of the mean weight of a class.

    It is at least `min_objects`, and at most the larger of that and 25 (C45Split.handleNumericAttribute).
    """
    tenth = 0.1 * known_weight / n_classes
    if tenth - min_objects < TOLERANCE:
        return min_objects
    return 25.0 if tenth - 25.0 > TOLERANCE else tenth


def has_enough_rows(known_rows: int, min_side: float) -> bool:
    """Return whether the known rows suffice for two sides. Rows are counted, not weighed (C45Split)."""
    return 2.0 * min_side - known_rows <= TOLERANCE


# --------------------------------------------------------------------------------------------- cuts of an attribute


def are_apart(low: float, high: float) -> bool:
    """Return whether a cut between two neighbouring values is admissible."""
    return low + GAP < high


def is_better_cut(numerator: int, best: int, tolerance: int, least: int) -> bool:
    """Return whether a cut replaces the best one of a scan; `best` is 0 where there is none yet.

    All are numerators of gains (see `gain`) in fixed point; `tolerance` is that of `gain_tolerance`, and a numerator
    below `least` counts as no gain.
    """
    return numerator - best > tolerance and numerator >= least


def gain_tolerance(weight: float, term_bits: int) -> int:
    """Return the tolerance of a gain as a difference of fixed-point numerators; compared with > as an integer."""
    return math.floor(math.ldexp(TOLERANCE * LN2 * weight, term_bits))


def least_numerator(weight: float, known_weight: float, term_bits: int) -> int:
    """Return the fixed-point numerator below which a gain counts as 0."""
    return math.ceil(math.ldexp(TOLERANCE * LN2 * weight / known_weight, term_bits))


def least_units(weight: float, weight_bits: int) -> int:
    """Return the least fixed-point weight that counts as `weight` or more."""
    return math.floor(math.ldexp(weight - TOLERANCE, weight_bits)) + 1


def midpoint(low: float, high: float) -> float:
    """Return the number halfway between two values, the lower value where rounding would give the higher.

    Where the sum of the values overflows, their halves are added. In that case J48 sends every row left and never
    ends (C45Split).
    """
    middle = (low + high) / 2.0
    if not math.isfinite(middle):
        middle = low / 2.0 + high / 2.0
    return low if middle == high else middle


# ------------------------------------------------------------------------------------------------ gain and gain ratio


def gain(numerator: float, known_weight: float, weight: float) -> float:
    """Return the information gain per unit weight, in bits, discounted for rows that do not know the value.

    `numerator` is L(T) - sum L(class) + sum over sides (sum L(class) - L(side)) (InfoGainSplitCrit).
    """
    unknown_rate = (weight - known_weight) / weight
    total = (1.0 - unknown_rate) * (numerator / LN2)
    return 0.0 if abs(total) < TOLERANCE else total / known_weight


def gain_ratio(gain_value: float, split_numerator: float, weight: float) -> float:
    """Return the gain over the split information, 0 where that is 0 (GainRatioSplitCrit).

    `split_numerator` is L(W) - sum L(side) - L(W - T).
    """
    split_information = split_numerator / LN2
    return 0.0 if abs(split_information) < TOLERANCE else gain_value / (split_information / weight)


def threshold_cost(n_cuts: int, weight: float) -> float:
    """Return the cost, in bits per unit weight, of naming one of `n_cuts` thresholds (C4.5 release 8)."""
    return ln(real_weight(n_cuts, 0)) / LN2 / weight


def gain_of_cut(
    numerator: int, n_cuts: int, known: int, weight: int, scale: Scale, mdl_correction: bool
) -> float:
    """Return the gain of a numeric test, in bits.

    numerator: of the gain, in fixed point. n_cuts: the number of admissible cuts. known, weight: T and W in fixed
    point.
    mdl_correction: whether the cost of the threshold is subtracted.
    """
    real = real_weight(weight, scale.weight_bits)
    value = gain(real_term(numerator, scale.term_bits), real_weight(known, scale.weight_bits), real)
    if mdl_correction:
        value = value - threshold_cost(n_cuts, real)
    return value


def ratio_of_cut(gain_value: float, split: int, weight: int, scale: Scale) -> float:
    """Return the gain ratio of a numeric test.

    split: L(W) - L(left) - L(T - left) - L(W - T) in fixed point. weight: W in fixed point.
    """
    return gain_ratio(gain_value, real_term(split, scale.term_bits), real_weight(weight, scale.weight_bits))


def choose_attribute(
    usable: Truths, gains: Numbers, ratios: Numbers, averaged: Truths, by_ratio: bool
) -> int:
    """Return the attribute to split on, -1 where none is eligible (C45ModelSelection).

    The chosen attribute is the first one whose score is not exceeded by more than the tolerance. The score is the gain,
    or with `by_ratio` the gain ratio of the attributes that have at least the average gain of the `averaged` ones.
    """
    average = -math.inf
    if by_ratio:
        total, number = 0.0, 0
        for a in range(len(gains)):
            if usable[a] and averaged[a]:
                total += gains[a]
                number += 1
        average = total / number if number > 0 else math.inf
    best, chosen = 0.0, -1
    for a in range(len(gains)):
        score = ratios[a] if by_ratio else gains[a]
        if usable[a] and gains[a] >= average - AVERAGE_SLACK and score - best > TOLERANCE:
            best, chosen = score, a
    return chosen


# ---------------------------------------------------------------------------------------------------------- pruning


def collapses(errors_below: int, errors_as_leaf: int, slack: float) -> bool:
    """Return whether a subtree saves too few training errors to be kept; all in fixed-point weight."""
    return errors_below >= errors_as_leaf - slack


def is_no_worse(errors: int, other: int, limit: int) -> bool:
    """Return whether a smaller tree is no worse than another one, from the estimated errors of both in fixed point.

    `limit` is the least excess that counts; see `estimates.Estimation`.
    """
    return errors - other < limit


def leaf_is_best(as_leaf: int, as_tree: int, as_branch: int, limit: int) -> bool:
    """Return whether a node becomes a leaf, from the estimated errors as leaf, as tree and as its heaviest branch.

    A node that does not is replaced by its heaviest branch where that is no worse than the tree.
    """
    return is_no_worse(as_leaf, as_tree, limit) and is_no_worse(as_leaf, as_branch, limit)


def is_not_lighter(weight: float, other: float) -> bool:
    """Return whether a branch replaces another one as the heaviest (Distribution.maxBag: the last one of equals)."""
    return other - weight < TOLERANCE
