"""The predictions of a tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import Indices, Reals
from graspsense_c45.table import check_values
from graspsense_c45.tree import LEAF, Splits, Tree, largest_class

CHUNK = 16_384
"""Rows that are routed together: their arrays fit into the processor's caches."""
NO_LEAF = -1
"""The leaf of a row that lacks a value which is tested."""


def distributions(tree: Tree, values: ArrayLike) -> Reals:
    """Return the probability of every class for every row (rows x classes).

    values: rows x attributes; NaN is missing.

    Raises ValueError for a number of columns that does not fit the tree, for infinite values, and for numbers in
    nominal columns that are not indices of declared values.
    """
    return _distributions(tree, _checked(tree, values), tree.laplace)


def class_indices(tree: Tree, values: ArrayLike) -> Indices:
    """Return the index of the class of every row, as J48 classifies: the first largest unsmoothed probability.

    Raises ValueError as `distributions` does.
    """
    return largest_class(_distributions(tree, _checked(tree, values), laplace=False))


def leaf_weights(tree: Tree, values: ArrayLike) -> Reals:
    """Return the training weight in the leaf of each row; NaN for a row that lacks a value which is tested.

    Raises ValueError as `distributions` does.
    """
    leaves = _leaves(tree.splits, _checked(tree, values))
    return np.where(leaves == NO_LEAF, np.nan, tree.weighted_n_node_samples[leaves])


def node_distributions(tree: Tree, laplace: bool) -> Reals:
    """Return the distribution at each node; a leaf without training weight has that of its parent."""
    weights, total = tree.class_weights, tree.weighted_n_node_samples
    n_classes = weights.shape[1]
    if laplace:
        of_nodes = (weights + 1.0) / (total + n_classes)[:, None]
    else:
        of_nodes = weights / np.where(total > 0, total, 1.0)[:, None]
    of_nodes[tree.empty] = of_nodes[tree.parent[tree.empty]]
    return np.asarray(of_nodes)


def _distributions(tree: Tree, x: Reals, laplace: bool) -> Reals:
    of_nodes = node_distributions(tree, laplace)
    leaves = _leaves(tree.splits, x)
    result = of_nodes[leaves]
    partial = np.flatnonzero(leaves == NO_LEAF)
    for begin in range(0, len(partial), CHUNK):
        rows = partial[begin : begin + CHUNK]
        result[rows] = _blended(tree, x[rows], of_nodes)
    return result


def _leaves(splits: Splits, x: Reals) -> Indices:
    """Return the leaf of each row, `NO_LEAF` for a row that lacks a value which is tested."""
    flat, width = np.ascontiguousarray(x).reshape(-1), x.shape[1]
    nominal = bool(np.isnan(splits.threshold[splits.feature != LEAF]).any())
    # The minimum of an array with a NaN is NaN.
    complete = not np.isnan(x.min(initial=0.0))
    result = np.zeros(len(x), dtype=np.int64)
    for begin in range(0, len(x), CHUNK):
        index = np.arange(begin, min(begin + CHUNK, len(x)))
        node = result[index]
        while index.size:
            feature = splits.feature[node]
            on_way = feature != LEAF
            if not on_way.all():
                result[index] = node
                index, node, feature = index[on_way], node[on_way], feature[on_way]
            tested = flat[index * width + feature]
            if not complete and np.isnan(tested).any():
                known = ~np.isnan(tested)
                result[index[~known]] = NO_LEAF
                index, node, tested = index[known], node[known], tested[known]
            slots = splits.slot(node, tested) if nominal else tested > splits.threshold[node]
            node = splits.first_child[node] + slots
    return result


def _blended(tree: Tree, x: Reals, of_nodes: Reals) -> Reals:
    """Return the distributions of rows with missing values: means over all children, by training weight."""
    splits, total = tree.splits, tree.weighted_n_node_samples
    result = np.zeros((len(x), of_nodes.shape[1]))
    rows, nodes, parts = np.arange(len(x)), np.zeros(len(x), dtype=np.int64), np.ones(len(x))
    while rows.size:
        ended = splits.feature[nodes] == LEAF
        np.add.at(result, rows[ended], parts[ended, None] * of_nodes[nodes[ended]])
        rows, nodes, parts = rows[~ended], nodes[~ended], parts[~ended]
        slots = splits.slot(nodes, x[rows, splits.feature[nodes]])
        known = slots >= 0
        children = splits.first_child[nodes[known]] + slots[known]
        missing = nodes[~known]
        each = splits.n_children[missing]
        all_children = splits.children(missing)
        fraction = total[all_children] / np.repeat(total[missing], each)
        kept = total[all_children] >= TOLERANCE
        rows, nodes, parts = (
            np.concatenate((rows[known], np.repeat(rows[~known], each)[kept])),
            np.concatenate((children, all_children[kept])),
            np.concatenate((parts[known], (np.repeat(parts[~known], each) * fraction)[kept])),
        )
    return result


def _checked(tree: Tree, values: ArrayLike) -> Reals:
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != len(tree.schema.attributes):
        raise ValueError(f"values have the shape {x.shape}; expected (rows, {len(tree.schema.attributes)})")
    check_values(tree.schema, x)
    return x
