"""The split of a nominal attribute at one node."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import FixedPoint
from graspsense_c45.splits import ALL_VALUES
from graspsense_c45.training_set import TrainingSet


class Split(NamedTuple):
    """The best split of an attribute: whether it may be chosen, its gain and gain ratio in bits, and its category."""

    usable: bool
    gain: float
    ratio: float
    category: int = ALL_VALUES


def split_by_values(counts: FixedPoint, weight: int, training: TrainingSet) -> Split:
    """Return the split into one child for each value, or with `binary_splits` of one value against the others.

    counts: values x classes, of the rows that know the value. weight: of all rows at the node.
    """
    nominal = _Nominal(counts, weight, training)
    if training.options.binary_splits:
        return _one_against_the_others(nominal)
    usable = bool((nominal.value_weights >= nominal.enough).sum() >= 2)
    sides = int((nominal.terms - nominal.value_terms).sum())
    return Split(usable, *nominal.gain_and_ratio(sides, int(nominal.value_terms.sum())))


def _one_against_the_others(nominal: _Nominal) -> Split:
    """Return the best split of one value against the others (J48 -B)."""
    training = nominal.training
    by_ratio = training.options.criterion == "gain_ratio"
    best = Split(False, 0.0, 0.0)
    usable = False
    for value, value_weight in enumerate(nominal.value_weights.tolist()):
        rest_weight = nominal.known - value_weight
        if value_weight < nominal.enough or rest_weight < nominal.enough:
            continue
        usable = True
        others = nominal.counts.sum(axis=0) - nominal.counts[value]
        rest_term, value_term = int(training.terms(rest_weight)), int(nominal.value_terms[value])
        sides = int(nominal.terms[value]) - value_term + int(training.terms(others).sum()) - rest_term
        gain, ratio = nominal.gain_and_ratio(sides, value_term + rest_term)
        score, highest = (ratio, best.ratio) if by_ratio else (gain, best.gain)
        if value == 0 or score - highest > TOLERANCE:
            best = Split(True, gain, ratio, value)
    return best._replace(usable=usable)


class _Nominal:
    """The weights and terms of a nominal attribute at a node."""

    def __init__(self, counts: FixedPoint, weight: int, training: TrainingSet) -> None:
        self.counts, self.weight, self.training = counts, weight, training
        self.value_weights = counts.sum(axis=1)
        self.known = int(self.value_weights.sum())
        self.enough = int(training.least_units(training.options.min_objects))
        self.terms = training.terms(counts).sum(axis=1)
        self.value_terms = training.terms(self.value_weights)
        class_terms = int(training.terms(counts.sum(axis=0)).sum())
        self._before = int(training.terms(self.known)) - class_terms
        self._outside = int(training.terms(weight)) - int(training.terms(weight - self.known))

    def gain_and_ratio(self, sides: int, split: int) -> tuple[float, float]:
        """Return gain and gain ratio, from the sums over sides of L(class) - L(side), and of L(side)."""
        training = self.training
        known = float(training.real_weights(np.int64(self.known))) if self.known > 0 else 1.0
        weight = float(training.real_weights(np.int64(self.weight)))
        gain = criteria.gain(float(training.real_terms(np.int64(self._before + sides))), known, weight)
        split_numerator = float(training.real_terms(np.int64(self._outside - split)))
        return float(gain), float(criteria.gain_ratio(float(gain), split_numerator, weight))
