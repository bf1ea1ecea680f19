"""Which attribute a node splits on, for many nodes at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE, Array, ln_of_parts
from graspsense_c45.problem import Problem

NONE = -1


@dataclass(slots=True)
class Offers:
    """The best split of every attribute (rows) at every node (columns).

    value: of a nominal attribute, the value sent to the first son, or -1 for one son a value.
    """

    usable: NDArray[np.bool_]
    gain: NDArray[np.float64]
    ratio: NDArray[np.float64]
    value: NDArray[np.int32]

    @classmethod
    def none(cls, n_attributes: int, n_nodes: int) -> Offers:
        """No usable split anywhere."""
        shape = (n_attributes, n_nodes)
        return cls(
            np.zeros(shape, dtype=bool), np.zeros(shape), np.zeros(shape), np.full(shape, -1, dtype=np.int32)
        )

    def choose(self, problem: Problem) -> NDArray[np.int64]:
        """The attribute to split on at each node, or -1: the first one not beaten by more than the tolerance."""
        n_attributes, n_nodes = self.gain.shape
        by_ratio = problem.options.criterion == "gain_ratio"
        eligible = self.usable
        if by_ratio:
            total = np.zeros(n_nodes)
            number = np.zeros(n_nodes)
            for a in np.flatnonzero(problem.averaged).tolist():
                total = total + np.where(self.usable[a], self.gain[a], 0.0)
                number = number + self.usable[a]
            average = total / np.maximum(number, 1.0)
            eligible = eligible & (self.gain >= average - criteria.AVERAGE_SLACK) & (number > 0)
        scores = self.ratio if by_ratio else self.gain
        best = np.zeros(n_nodes)
        chosen = np.full(n_nodes, NONE)
        for a in range(n_attributes):
            better = eligible[a] & (scores[a] - best > TOLERANCE)
            best = np.where(better, scores[a], best)
            chosen = np.where(better, a, chosen)
        return chosen


def offer_cuts(
    offers: Offers,
    attribute: Array,
    node: Array,
    numerator: Array,
    n_cuts: Array,
    left: Array,
    known: Array,
    weight: Array,
    problem: Problem,
) -> None:
    """Enter cuts of numeric attributes, one a position: numerator, number of admissible cuts, fixed-point weights."""
    real_known = problem.real_weights(known)
    real_weight = problem.real_weights(weight)
    gain = criteria.gain(problem.real_terms(numerator), real_known, real_weight)
    if problem.options.mdl_correction:
        gain = gain - criteria.mdl_cost(ln_of_parts(*np.frexp(n_cuts.astype(np.float64))), real_weight)
    split = (
        problem.terms(weight)
        - problem.terms(left)
        - problem.terms(known - left)
        - problem.terms(weight - known)
    )
    offers.usable[attribute, node] = gain >= TOLERANCE
    offers.gain[attribute, node] = gain
    offers.ratio[attribute, node] = criteria.gain_ratio(gain, problem.real_terms(split), real_weight)


def offer_values(offers: Offers, attribute: int, counts: Array, weight: Array, problem: Problem) -> None:
    """Enter the split of a nominal attribute at every node; ``counts`` is nodes x values x classes, known rows only."""
    bags = counts.sum(axis=2)
    known = bags.sum(axis=1)
    real_known = np.where(known > 0, problem.real_weights(known), 1.0)
    real_weight = problem.real_weights(weight)
    enough = problem.units_at_least(np.float64(problem.options.min_objects))
    class_terms = problem.terms(counts.sum(axis=1)).sum(axis=1)
    before = problem.terms(known) - class_terms
    outside = problem.terms(weight) - problem.terms(weight - known)
    inside_terms = problem.terms(counts).sum(axis=2)
    bag_terms = problem.terms(bags)
    if not problem.options.binary_splits:
        offers.usable[attribute] = (bags >= enough).sum(axis=1) >= 2
        numerator = before + (inside_terms - bag_terms).sum(axis=1)
        gain = criteria.gain(problem.real_terms(numerator), real_known, real_weight)
        offers.gain[attribute] = gain
        split = outside - bag_terms.sum(axis=1)
        offers.ratio[attribute] = criteria.gain_ratio(gain, problem.real_terms(split), real_weight)
        return
    by_ratio = problem.options.criterion == "gain_ratio"
    for value in range(counts.shape[1]):
        rest = counts.sum(axis=1) - counts[:, value]
        rest_weight = known - bags[:, value]
        possible = (bags[:, value] >= enough) & (rest_weight >= enough)
        sides = (
            inside_terms[:, value]
            - bag_terms[:, value]
            + problem.terms(rest).sum(axis=1)
            - problem.terms(rest_weight)
        )
        gain = criteria.gain(problem.real_terms(before + sides), real_known, real_weight)
        split = outside - bag_terms[:, value] - problem.terms(rest_weight)
        ratio = criteria.gain_ratio(gain, problem.real_terms(split), real_weight)
        score, best = (ratio, offers.ratio[attribute]) if by_ratio else (gain, offers.gain[attribute])
        better = possible & ((value == 0) | (score - best > TOLERANCE))
        offers.usable[attribute] |= possible
        offers.gain[attribute] = np.where(better, gain, offers.gain[attribute])
        offers.ratio[attribute] = np.where(better, ratio, offers.ratio[attribute])
        offers.value[attribute] = np.where(better, value, offers.value[attribute])
