"""The best split of each attribute at each of many nodes, and the choice among them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from attrs import define

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import FixedPoint, Indices, Mask, NodeColumn, Reals
from graspsense_c45.training_set import TrainingSet

NO_SPLIT = -1
"""Stands for an attribute where a node is not split."""


class Cuts(NamedTuple):
    """Cuts of numeric attributes; each array has one entry per cut.

    attribute, node: what is cut. numerator: of the gain (see `criteria.gain`), in fixed point. n_cuts: admissible cuts.
    left, known, weight: of the rows at most at the cut, of those that know the value, and of all, in fixed point.
    """

    attribute: Indices
    node: Indices
    numerator: FixedPoint
    n_cuts: Indices
    left: FixedPoint
    known: FixedPoint
    weight: FixedPoint


@define(eq=False)
class CandidateSplits:
    """The best split of every attribute (rows) at every node (columns).

    usable: whether it may be chosen. gain, ratio: its gain and gain ratio in bits. category: for a nominal attribute,
    the value that goes to the first child, or -1 for one child per value.
    """

    usable: Mask
    gain: Reals
    ratio: Reals
    category: NodeColumn

    @classmethod
    def none(cls, n_attributes: int, n_nodes: int) -> CandidateSplits:
        """Return no usable split for any attribute and node."""
        shape = (n_attributes, n_nodes)
        return cls(
            np.zeros(shape, dtype=bool), np.zeros(shape), np.zeros(shape), np.full(shape, -1, dtype=np.int32)
        )

    def choose(self, training: TrainingSet) -> Indices:
        """Return the attribute to split on at each node, or -1; see `criteria.choose_attribute`."""
        chosen = np.full(self.gain.shape[1], NO_SPLIT)
        chosen[:] = criteria.choose_attribute(
            self.usable,
            self.gain,
            self.ratio,
            training.averaged,
            training.options.criterion == "gain_ratio",
        )
        return chosen

    def enter_cuts(self, cuts: Cuts, training: TrainingSet) -> None:
        """Enter the cuts of numeric attributes."""
        scale, place = training.scale, (cuts.attribute, cuts.node)
        gain = criteria.gain_of_cut(
            cuts.numerator, cuts.n_cuts, cuts.known, cuts.weight, scale, training.options.mdl_correction
        )
        self.usable[place] = gain >= TOLERANCE
        self.gain[place] = gain
        self.ratio[place] = criteria.ratio_of_cut(gain, cuts.left, cuts.known, cuts.weight, scale)

    def enter_values(
        self, attribute: int, counts: FixedPoint, weight: FixedPoint, training: TrainingSet
    ) -> None:
        """Enter the split of a nominal attribute at every node.

        counts: nodes x values x classes, of the rows that know the value. weight: of all rows at each node.
        """
        nominal = _Nominal(counts, weight, training)
        if training.options.binary_splits:
            self._enter_one_against_the_others(attribute, nominal)
        else:
            self.usable[attribute] = (nominal.value_weights >= nominal.enough).sum(axis=1) >= 2
            sides = (nominal.terms - nominal.value_terms).sum(axis=1)
            split = nominal.value_terms.sum(axis=1)
            self.gain[attribute], self.ratio[attribute] = nominal.gain_and_ratio(sides, split)

    def _enter_one_against_the_others(self, attribute: int, nominal: _Nominal) -> None:
        """Enter the best split of one value against the others (J48 -B)."""
        training = nominal.training
        by_ratio = training.options.criterion == "gain_ratio"
        for value in range(nominal.counts.shape[1]):
            rest = nominal.counts.sum(axis=1) - nominal.counts[:, value]
            rest_weight = nominal.known - nominal.value_weights[:, value]
            possible = (nominal.value_weights[:, value] >= nominal.enough) & (rest_weight >= nominal.enough)
            rest_term, value_term = training.terms(rest_weight), nominal.value_terms[:, value]
            sides = nominal.terms[:, value] - value_term + training.terms(rest).sum(axis=1) - rest_term
            gain, ratio = nominal.gain_and_ratio(sides, value_term + rest_term)
            score, best = (ratio, self.ratio[attribute]) if by_ratio else (gain, self.gain[attribute])
            better = possible & ((value == 0) | (score - best > TOLERANCE))
            self.usable[attribute] |= possible
            self.gain[attribute] = np.where(better, gain, self.gain[attribute])
            self.ratio[attribute] = np.where(better, ratio, self.ratio[attribute])
            self.category[attribute] = np.where(better, value, self.category[attribute])


class _Nominal:
    """The weights and terms of a nominal attribute, at every node."""

    def __init__(self, counts: FixedPoint, weight: FixedPoint, training: TrainingSet) -> None:
        self.counts, self.weight, self.training = counts, weight, training
        self.value_weights = counts.sum(axis=2)
        self.known = self.value_weights.sum(axis=1)
        self.enough = training.least_units(training.options.min_objects)
        self.terms = training.terms(counts).sum(axis=2)
        self.value_terms = training.terms(self.value_weights)
        class_terms = training.terms(counts.sum(axis=1)).sum(axis=1)
        self._before = training.terms(self.known) - class_terms
        self._outside = training.terms(weight) - training.terms(weight - self.known)

    def gain_and_ratio(self, sides: FixedPoint, split: FixedPoint) -> tuple[Reals, Reals]:
        """Return gain and gain ratio, from the sums over sides of L(class) - L(side), and of L(side)."""
        training = self.training
        real_known = np.where(self.known > 0, training.real_weights(self.known), 1.0)
        real_weight = training.real_weights(self.weight)
        gain = criteria.gain(training.real_terms(self._before + sides), real_known, real_weight)
        ratio = criteria.gain_ratio(gain, training.real_terms(self._outside - split), real_weight)
        return np.asarray(gain), np.asarray(ratio)
