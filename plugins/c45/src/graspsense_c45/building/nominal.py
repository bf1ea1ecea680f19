"""The best split of a nominal attribute at a node."""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arithmetic import TOLERANCE, Scale, real_term, real_weight, term
from graspsense_c45.arrays import Integers, IntegerTable
from graspsense_c45.building.nodes import weight_of
from graspsense_c45.criteria import gain, gain_ratio
from graspsense_c45.tree import ALL_VALUES


class Values(NamedTuple):
    """The weights of a nominal attribute at a node, in fixed point.

    counts: values x classes, of the rows that know the value; more values may follow. n_values: declared ones. totals:
    of each class. weight: of all rows at the node. enough: least weight of a branch that counts.
    """

    counts: IntegerTable
    n_values: int
    totals: Integers
    weight: int
    enough: int
    scale: Scale


class ValueSplit(NamedTuple):
    """A split of a nominal attribute: whether it may be chosen, its gain and gain ratio in bits, and its category."""

    usable: bool
    gain: float
    ratio: float
    category: int


def split_all_values(values: Values) -> ValueSplit:
    """Return the split into one child for each value."""
    heavy, within, sides = 0, 0, 0
    for value in range(values.n_values):
        weight = weight_of(values.counts[value])
        heavy += weight >= values.enough
        within += sum_of_terms(values.counts[value], values.scale)
        sides += term(weight, values.scale)
    score = score_of_sides(within, sides, values)
    return ValueSplit(heavy >= 2, score.gain, score.ratio, ALL_VALUES)


def split_value_off(values: Values, by_ratio: bool) -> ValueSplit:
    """Return the best split of one value against the others (J48 -B)."""
    known = weight_of(values.totals)
    best = ValueSplit(False, 0.0, 0.0, ALL_VALUES)
    for value in range(values.n_values):
        counts, scale = values.counts[value], values.scale
        weight = weight_of(counts)
        if weight < values.enough or known - weight < values.enough:
            continue
        within = sum_of_terms(counts, scale)
        for k in range(len(counts)):
            within += term(values.totals[k] - counts[k], scale)
        score = score_of_sides(within, term(weight, scale) + term(known - weight, scale), values)
        higher = score.ratio - best.ratio if by_ratio else score.gain - best.gain
        if value == 0 or higher > TOLERANCE:
            best = ValueSplit(True, score.gain, score.ratio, value)
        else:
            best = ValueSplit(True, best.gain, best.ratio, best.category)
    return best


class Score(NamedTuple):
    """Gain and gain ratio in bits."""

    gain: float
    ratio: float


def score_of_sides(within: int, sides: int, values: Values) -> Score:
    """Return the score of a split, from the sums over its sides of L(class) and of L(side); see `criteria.gain`."""
    scale = values.scale
    known = weight_of(values.totals)
    known_weight = real_weight(known, scale.weight_bits) if known > 0 else 1.0
    weight = real_weight(values.weight, scale.weight_bits)
    numerator = term(known, scale) - sum_of_terms(values.totals, scale) + within - sides
    gained = gain(real_term(numerator, scale.term_bits), known_weight, weight)
    split = term(values.weight, scale) - term(values.weight - known, scale) - sides
    return Score(gained, gain_ratio(gained, real_term(split, scale.term_bits), weight))


def sum_of_terms(counts: Integers, scale: Scale) -> int:
    """Return the sum over classes of L(class), in fixed point."""
    total = 0
    for k in range(len(counts)):
        total += term(counts[k], scale)
    return total
