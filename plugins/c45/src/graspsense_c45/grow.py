"""Growing level by level: what all row layouts share."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import Array
from graspsense_c45.branches import ALL_VALUES, LEAF, Branches
from graspsense_c45.problem import Problem
from graspsense_c45.selection import NONE, Offers


class Level(Protocol):
    """The rows of all open nodes of one depth, in some layout."""

    def offers(self) -> Offers:
        """The best split of every attribute at every open node."""

    def thresholds(self, attribute: Array) -> NDArray[np.float64]:
        """The midpoints of the chosen attributes, one an open node; NaN where none or a nominal one is chosen."""

    def split(self, attribute: Array, value: Array, n_sons: Array) -> NDArray[np.int64]:
        """Give the rows to the sons of the nodes; returns the sons' counts (sons x classes), in order."""

    def descend(self, open_sons: NDArray[np.bool_]) -> Array:
        """Go on with these sons; returns their indices among all sons, in the order of the new layout."""


def grow(problem: Problem, level: Level) -> Branches:
    """The unpruned tree; thresholds are midpoints."""
    counts = np.bincount(problem.labels, weights=problem.weights, minlength=problem.n_classes).astype(
        np.int64
    )[None, :]
    grown = _Growing(counts)
    nodes = np.zeros(1 if is_open(counts, problem)[0] else 0, dtype=np.int64)
    while nodes.size:
        offers = level.offers()
        attribute = offers.choose(problem)
        value = np.where(attribute == NONE, ALL_VALUES, offers.value[attribute, np.arange(nodes.size)])
        declared = problem.value_counts[attribute]
        n_sons = np.where((declared > 0) & (value == ALL_VALUES), declared, 2)
        n_sons[attribute == NONE] = 0
        thresholds = level.thresholds(attribute)
        sons = level.split(attribute, value, n_sons)
        first = grown.split(nodes, attribute, thresholds, value, n_sons, sons)
        nodes = first + level.descend(is_open(sons, problem))
    return grown.branches()


def is_open(counts: Array, problem: Problem) -> NDArray[np.bool_]:
    """Whether nodes with these counts may be split."""
    weight = problem.real_weights(counts.sum(axis=1))
    majority = problem.real_weights(counts[np.arange(len(counts)), majority_class(counts, problem)])
    closed: NDArray[np.bool_] = criteria.is_pure_or_small(weight, majority, problem.options.min_objects)
    return ~closed


def majority_class(counts: Array, problem: Problem) -> NDArray[np.int64]:
    """The lowest class not beaten by more than the tolerance, for each row of counts."""
    if problem.weight_bits == 0:
        return np.asarray(np.argmax(counts, axis=1))
    margin = problem.weight_margin
    best = np.zeros(len(counts), dtype=np.int64)
    chosen = np.zeros(len(counts), dtype=np.int64)
    for k in range(counts.shape[1]):
        better = counts[:, k] - best > margin
        best = np.where(better, counts[:, k], best)
        chosen = np.where(better, k, chosen)
    return chosen


class _Growing:
    """The columns of a tree, one piece a level."""

    def __init__(self, root_counts: Array) -> None:
        self._n_nodes = 1
        self._counts = [root_counts]
        self._splits: list[tuple[Array, ...]] = []

    def split(
        self, nodes: Array, attribute: Array, thresholds: Array, value: Array, n_sons: Array, sons: Array
    ) -> int:
        """Split these nodes (attribute -1: not this one); returns the number of the first of all sons."""
        first = self._n_nodes
        taken = np.flatnonzero(attribute != NONE)
        first_son = first + np.cumsum(n_sons) - n_sons
        columns = (attribute, thresholds, value, first_son, n_sons)
        self._splits.append((nodes[taken], *(column[taken] for column in columns)))
        self._counts.append(sons)
        self._n_nodes += len(sons)
        return first

    def branches(self) -> Branches:
        n = self._n_nodes
        tree = Branches(
            attribute=np.full(n, LEAF, dtype=np.int32),
            threshold=np.full(n, np.nan),
            value=np.full(n, ALL_VALUES, dtype=np.int32),
            first_son=np.zeros(n, dtype=np.int32),
            n_sons=np.zeros(n, dtype=np.int32),
            counts=np.concatenate(self._counts),
        )
        for nodes, attribute, thresholds, value, first_son, n_sons in self._splits:
            tree.attribute[nodes] = attribute
            tree.threshold[nodes] = thresholds
            tree.value[nodes] = value
            tree.first_son[nodes] = first_son
            tree.n_sons[nodes] = n_sons
        return tree


def midpoints(low: Array, high: Array) -> NDArray[np.float64]:
    """Halfway between two values, the lower one where rounding would give the higher.

    J48 adds first; where that overflows it sends every row left and never ends, here the halves are added.
    """
    with np.errstate(over="ignore"):
        middle = (low + high) / 2.0
    middle = np.where(np.isfinite(middle), middle, low / 2.0 + high / 2.0)
    return np.where(middle == high, low, middle)
