"""The predictions of a tree."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import Indices, Reals
from graspsense_c45.engines import choose_fast
from graspsense_c45.options import Engine
from graspsense_c45.routing import CHUNK, leaves_of_rows
from graspsense_c45.splits import LEAF
from graspsense_c45.table import check_values
from graspsense_c45.tree import Tree, largest_class


def distributions(tree: Tree, values: ArrayLike, engine: Engine = "auto") -> Reals:
    """Return the probability of every class for every row (rows x classes).

    values: rows x attributes; NaN is missing.

    Raises ValueError for a number of columns that does not fit the tree, for infinite values, and for numbers in
    nominal columns that are not indices of declared values.
    """
    x = _checked(tree, values)
    of_nodes = node_distributions(tree, tree.laplace)
    complete, partial = _by_completeness(x)
    if partial is None:
        return of_nodes[_leaves(tree, x, engine)]
    result = np.empty((len(x), of_nodes.shape[1]))
    result[complete] = of_nodes[_leaves(tree, x[complete], engine)]
    for begin in range(0, len(partial), CHUNK):
        rows = partial[begin : begin + CHUNK]
        result[rows] = _blended(tree, x[rows], of_nodes)
    return result


def class_indices(tree: Tree, values: ArrayLike, engine: Engine = "auto") -> Indices:
    """Return the index of the class of every row, as J48 classifies: the first largest unsmoothed probability.

    Raises ValueError as `distributions` does.
    """
    x = _checked(tree, values)
    of_nodes = node_distributions(tree, laplace=False)
    complete, partial = _by_completeness(x)
    labels = largest_class(of_nodes)
    if partial is None:
        return labels[_leaves(tree, x, engine)]
    result = np.empty(len(x), dtype=np.int64)
    result[complete] = labels[_leaves(tree, x[complete], engine)]
    for begin in range(0, len(partial), CHUNK):
        rows = partial[begin : begin + CHUNK]
        result[rows] = largest_class(_blended(tree, x[rows], of_nodes))
    return result


def leaf_weights(tree: Tree, values: ArrayLike) -> Reals:
    """Return the training weight in the leaf of each row; NaN for a row that lacks a value which is tested.

    Raises ValueError as `distributions` does.
    """
    x = _checked(tree, values)
    splits, result = tree.splits, np.full(len(x), np.nan)
    rows, nodes = np.arange(len(x)), np.zeros(len(x), dtype=np.int64)
    while rows.size:
        ended = splits.feature[nodes] == LEAF
        result[rows[ended]] = tree.weighted_n_node_samples[nodes[ended]]
        rows, nodes = rows[~ended], nodes[~ended]
        slots = splits.slot(nodes, x[rows, splits.feature[nodes]])
        known = slots >= 0
        rows, nodes = rows[known], splits.first_child[nodes[known]] + slots[known]
    return result


def node_distributions(tree: Tree, laplace: bool) -> Reals:
    """Return the distribution at each node; a leaf without training weight has that of its parent."""
    weights, total = tree.class_weights, tree.weighted_n_node_samples
    n_classes = weights.shape[1]
    if laplace:
        of_nodes = (weights + 1.0) / (total + n_classes)[:, None]
    else:
        of_nodes = weights / np.where(total > 0, total, 1.0)[:, None]
    empty = np.flatnonzero((total < TOLERANCE) & (tree.parent >= 0))
    of_nodes[empty] = of_nodes[tree.parent[empty]]
    return np.asarray(of_nodes)


def _leaves(tree: Tree, x: Reals, engine: Engine) -> Indices:
    """Return the leaf of each row; no value may be missing."""
    if choose_fast(engine, x.size) and not any(attribute.is_nominal for attribute in tree.schema.attributes):
        from graspsense_c45.building import compiled

        return compiled.leaves_of_rows(tree.splits, x)
    return leaves_of_rows(tree.splits, x, np.arange(len(x)), np.zeros(len(x), dtype=np.int64))


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


def _by_completeness(x: Reals) -> tuple[Indices, Indices | None]:
    """Return the rows without and with missing values; (an empty array, None) if no value is missing."""
    # The minimum of an array with a NaN is NaN.
    if not np.isnan(x.min(initial=0.0)):
        return np.arange(0), None
    missing = np.isnan(x).any(axis=1)
    return np.flatnonzero(~missing), np.flatnonzero(missing)


def _checked(tree: Tree, values: ArrayLike) -> Reals:
    x = np.asarray(values, dtype=np.float64)
    if x.ndim != 2 or x.shape[1] != len(tree.schema.attributes):
        raise ValueError(f"values have the shape {x.shape}; expected (rows, {len(tree.schema.attributes)})")
    check_values(tree.schema, x)
    return x
