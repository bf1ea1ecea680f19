"""What makes a split good: the laws of C4.5's gain, gain ratio and minimum weights, as J48 has them.

All functions are elementwise, on scalars and on arrays. Terms ``x ln x`` come in and natural logarithms are divided out
here. W is the weight at a node, T the part of it whose value of the attribute is known.
Source: Quinlan, C4.5 (1993), sections 2.2 to 2.4; weka.classifiers.trees.j48 3.9.6 for every tolerance.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from graspsense_c45.arithmetic import LN2, TOLERANCE, select

GAP = 1e-5
"""A cut needs ``v[i] + GAP < v[i + 1]``: an absolute gap, whatever the column's scale."""

AVERAGE_SLACK = 1e-3
"""An attribute is eligible when its gain is at least the average gain less this."""

MANY_VALUES = 0.3
"""A nominal attribute with this share of values to rows, or more, stays out of the average gain."""

COLLAPSE_SLACK = 1e-3
PRUNING_SLACK = 0.1


def is_pure_or_small(weight: Any, majority_weight: Any, min_objects: Any) -> Any:
    """Whether a node is a leaf at once: fewer than twice the minimum weight, or one class only."""
    return (2.0 * min_objects - weight > TOLERANCE) | (weight - majority_weight < TOLERANCE)


def min_side_weight(known_weight: Any, n_classes: Any, min_objects: Any) -> Any:
    """The least weight of each side of a numeric cut: a tenth of the mean class weight, within [M, 25]."""
    tenth = 0.1 * known_weight / n_classes
    capped = select(tenth - 25.0 > TOLERANCE, 25.0, tenth)
    return select(tenth - min_objects < TOLERANCE, min_objects, capped)


def has_enough_rows(known_rows: Any, min_side: Any) -> Any:
    """Whether as many rows are known as two sides need; rows are counted here, not weighed."""
    return 2.0 * min_side - known_rows <= TOLERANCE


def gain(numerator: Any, known_weight: Any, weight: Any) -> Any:
    """Information gain in bits per unit weight, unknown values discounted.

    ``numerator`` is L(T) - sum L(class) + sum over sides (sum L(class) - L(side)), with L(x) = x ln x.
    """
    unknown_rate = (weight - known_weight) / weight
    total = (1.0 - unknown_rate) * (numerator / LN2)
    return select(np.abs(total) < TOLERANCE, 0.0, total / known_weight)


def gain_tolerance(weight: Any, term_bits: Any) -> Any:
    """The tolerance of a gain, as a difference of numerators in units of ``2**-term_bits`` (whole units matter)."""
    return np.floor(np.ldexp(TOLERANCE * LN2 * weight, term_bits))


def least_numerator(weight: Any, known_weight: Any, term_bits: Any) -> Any:
    """Below this numerator, in units of ``2**-term_bits``, a gain counts as none."""
    return np.ceil(np.ldexp(TOLERANCE * LN2 * weight / known_weight, term_bits))


def least_units(weight: Any, weight_bits: Any) -> Any:
    """The least number of units of ``2**-weight_bits`` that counts as ``weight`` or more."""
    return np.floor(np.ldexp(weight - TOLERANCE, weight_bits)) + 1.0


def mdl_cost(ln_cuts: Any, weight: Any) -> Any:
    """The price of naming one of so many cuts, in bits per unit weight (C4.5 release 8)."""
    return ln_cuts / LN2 / weight


def gain_ratio(gain_value: Any, split_numerator: Any, weight: Any) -> Any:
    """Gain over split information; ``split_numerator`` is L(W) - sum L(side) - L(W - T)."""
    split_information = split_numerator / LN2
    trivial = np.abs(split_information) < TOLERANCE
    return select(trivial, 0.0, gain_value / (select(trivial, 1.0, split_information) / weight))
