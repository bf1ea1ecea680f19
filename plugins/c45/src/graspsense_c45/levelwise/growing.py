"""Growing a tree level by level: what both layouts of the rows share."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, Mask, Reals
from graspsense_c45.levelwise.candidates import NO_SPLIT, CandidateSplits
from graspsense_c45.splits import ALL_VALUES, LEAF, GrowingTree
from graspsense_c45.training_set import TrainingSet


class NodeLevel(Protocol):
    """The rows of all open nodes of one depth. An open node is one that may still be split."""

    def candidates(self) -> CandidateSplits:
        """Return the best split of every attribute at every open node."""

    def thresholds(self, feature: Indices) -> Reals:
        """Return the midpoint for the chosen attribute of each open node; NaN where it is nominal or -1 (none)."""

    def split(self, feature: Indices, category: Indices, n_children: Indices) -> FixedPoint:
        """Assign the rows to the children; return the counts of the children (children x classes), in order."""

    def descend(self, open_children: Mask) -> Indices:
        """Continue with these children; return their indices among all children, in the order of the new layout."""


def grow(training: TrainingSet, level: NodeLevel) -> GrowingTree:
    """Return the unpruned tree, whose thresholds are midpoints.

    `depthfirst.growing.grow` grows the same tree; `tests/test_engines.py` checks that both agree to the bit.
    """
    counts = np.bincount(training.labels, weights=training.weights, minlength=training.n_classes)
    root_counts = counts.astype(np.int64)[None, :]
    columns = _Columns(root_counts)
    nodes = np.zeros(1 if is_open(root_counts, training)[0] else 0, dtype=np.int64)
    while nodes.size:
        candidates = level.candidates()
        feature = candidates.choose(training)
        category = np.where(
            feature == NO_SPLIT, ALL_VALUES, candidates.category[feature, np.arange(nodes.size)]
        )
        declared = training.value_counts[feature]
        n_children = np.where((declared > 0) & (category == ALL_VALUES), declared, 2)
        n_children[feature == NO_SPLIT] = 0
        thresholds = level.thresholds(feature)
        child_counts = level.split(feature, category, n_children)
        first = columns.split(nodes, (feature, thresholds, category, n_children), child_counts)
        nodes = first + level.descend(is_open(child_counts, training))
    return columns.tree()


def is_open(counts: FixedPoint, training: TrainingSet) -> Mask:
    """Return whether nodes with these counts may be split."""
    weight = training.real_weights(counts.sum(axis=1))
    majority = counts[np.arange(len(counts)), training.majority_class(counts)]
    closed = criteria.is_pure_or_small(weight, training.real_weights(majority), training.options.min_objects)
    return np.logical_not(closed)


def midpoints(low: Reals, high: Reals) -> Reals:
    """Return the thresholds between neighbouring values; see `criteria.midpoint`."""
    with np.errstate(over="ignore"):
        return np.asarray(criteria.midpoint(low, high))


class _Columns:
    """The columns of a growing tree, with one piece per level."""

    def __init__(self, root_counts: FixedPoint) -> None:
        self._n_nodes = 1
        self._counts = [root_counts]
        self._splits: list[tuple[AnyArray, ...]] = []

    def split(self, nodes: Indices, split: tuple[AnyArray, ...], child_counts: FixedPoint) -> int:
        """Split these nodes; return the index of the first child.

        `split`: feature (-1 where the node is not split), threshold, category and number of children of each node.
        """
        first = self._n_nodes
        feature, thresholds, category, n_children = split
        chosen = np.flatnonzero(feature != NO_SPLIT)
        first_child = first + np.cumsum(n_children) - n_children
        columns = (feature, thresholds, category, first_child, n_children)
        self._splits.append((nodes[chosen], *(column[chosen] for column in columns)))
        self._counts.append(child_counts)
        self._n_nodes += len(child_counts)
        return first

    def tree(self) -> GrowingTree:
        n = self._n_nodes
        tree = GrowingTree(
            feature=np.full(n, LEAF, dtype=np.int32),
            threshold=np.full(n, np.nan),
            category=np.full(n, ALL_VALUES, dtype=np.int32),
            first_child=np.zeros(n, dtype=np.int32),
            n_children=np.zeros(n, dtype=np.int32),
            counts=np.concatenate(self._counts),
        )
        for nodes, feature, thresholds, category, first_child, n_children in self._splits:
            tree.feature[nodes] = feature
            tree.threshold[nodes] = thresholds
            tree.category[nodes] = category
            tree.first_child[nodes] = first_child
            tree.n_children[nodes] = n_children
        return tree
