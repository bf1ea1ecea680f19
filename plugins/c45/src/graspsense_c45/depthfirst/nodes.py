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
        np.full(capacity, LEAF, dtype=np.int32),
        np.full(capacity, np.nan),
        np.zeros(capacity, dtype=np.int32),
        np.zeros((capacity, n_classes), dtype=np.int64),
        np.zeros(capacity, dtype=np.int64),
        np.zeros(capacity, dtype=np.int64),
    )


def resized(nodes: Nodes, n_nodes: int, capacity: int) -> Nodes:
    """Return the first `n_nodes` nodes in arrays for `capacity` nodes."""
    result = empty_nodes(capacity, nodes.counts.shape[1])
    result.feature[:n_nodes] = nodes.feature[:n_nodes]
    result.threshold[:n_nodes] = nodes.threshold[:n_nodes]
    result.first_child[:n_nodes] = nodes.first_child[:n_nodes]
    result.counts[:n_nodes] = nodes.counts[:n_nodes]
    result.start[:n_nodes] = nodes.start[:n_nodes]
    result.end[:n_nodes] = nodes.end[:n_nodes]
    return result


def no_nodes() -> list[np.int64]:
    """Return an empty list of nodes."""
    # Not by a comprehension: in a function that has one, numba 0.68 removes assignments to arrays inside named tuples
    # that the function has made; it takes them for dead code.
    nodes = [np.int64(0)]
    nodes.pop()
    return nodes


def make_leaf(node: Integer, nodes: Nodes) -> None:
    """Make a node a leaf."""
    nodes.feature[node], nodes.threshold[node], nodes.first_child[node] = LEAF, np.nan, 0


def subtree(nodes: Nodes, root: Integer) -> Indices:
    """Return the nodes of the tree below a root, itself first and every parent before its children."""
    inside = [np.int64(root)]
    stack = [np.int64(root)]
    while len(stack) > 0:
        node = stack.pop()
        if nodes.feature[node] != LEAF:
            child = np.int64(nodes.first_child[node])
            inside.append(child)
            inside.append(child + 1)
            stack.append(child + 1)
            stack.append(child)
    return np.array(inside)


def leaf_below(nodes: Nodes, node: Integer, values: Reals, row: Integer) -> Integer:
    """Return the leaf that a row comes to from a node."""
    while nodes.feature[node] != LEAF:
        node = nodes.first_child[node] + (values[row, nodes.feature[node]] > nodes.threshold[node])
    return node
