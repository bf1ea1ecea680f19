"""The data of the compiled engine, as named tuples of arrays: the nodes of a tree, and the rows."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arrays import FixedPoint, Indices, Integer, NodeColumn, Reals, SmallLabels
from graspsense_c45.splits import LEAF

RowIndices = NDArray[np.uint32]
"""Indices of rows. They are unsigned, so that compiled code need not check whether one counts from the end."""


class Nodes(NamedTuple):
    """The nodes of a binary tree; see `splits.Splits` for the first three columns.

    counts: nodes x classes, the fixed-point weight at each node.
    start, end: the interval of the sorted rows that are at the node.
    """

    feature: NodeColumn
    threshold: Reals
    first_child: NodeColumn
    counts: FixedPoint
    start: Indices
    end: Indices


class Rows(NamedTuple):
    """The rows of a training set. order: sorted by leaf. values: rows x attributes. labels, weights: one per row."""

    order: RowIndices
    values: Reals
    labels: SmallLabels
    weights: FixedPoint


def empty_nodes(capacity: int, n_classes: int) -> Nodes:
    """Return this many leaves without rows."""
    return Nodes(
        feature=np.full(capacity, LEAF, dtype=np.int32),
        threshold=np.full(capacity, np.nan),
        first_child=np.zeros(capacity, dtype=np.int32),
        counts=np.zeros((capacity, n_classes), dtype=np.int64),
        start=np.zeros(capacity, dtype=np.int64),
        end=np.zeros(capacity, dtype=np.int64),
    )


def make_leaf(node: Integer, nodes: Nodes) -> None:
    """Make a node a leaf."""
    nodes.feature[node], nodes.threshold[node], nodes.first_child[node] = LEAF, np.nan, 0


def list_subtree(nodes: Nodes, root: Integer, listed: Indices) -> Integer:
    """Write the nodes of the tree below a root to `listed`, every parent before its children; return their number."""
    listed[0] = root
    number = np.int64(1)
    i = np.int64(0)
    while i < number:
        node = listed[i]
        if nodes.feature[node] != LEAF:
            listed[number] = nodes.first_child[node]
            listed[number + 1] = nodes.first_child[node] + 1
            number += 2
        i += 1
    return number


def weight_of(counts: FixedPoint) -> Integer:
    """Return the weight of all classes."""
    weight = np.int64(0)
    for k in range(len(counts)):
        weight += counts[k]
    return weight


def leaf_below(nodes: Nodes, node: Integer, values: Reals, row: Integer) -> Integer:
    """Return the leaf that a row comes to from a node."""
    while nodes.feature[node] != LEAF:
        node = np.int64(nodes.first_child[node] + (values[row, nodes.feature[node]] > nodes.threshold[node]))
    return node
