"""Reduced-error pruning: a subtree becomes a leaf where that makes no more errors on held-out rows.

Source: Quinlan, Simplifying decision trees, Int. J. Man-Machine Studies 27 (1987); weka.classifiers.trees.j48 3.9.6,
PruneableClassifierTree.
"""

from __future__ import annotations

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE, WEIGHT_BITS, bits_below
from graspsense_c45.arrays import FixedPoint, Indices, Reals
from graspsense_c45.nodewise.collapsing import sum_in_runs
from graspsense_c45.routing import to_children
from graspsense_c45.splits import LEAF, ROOT, GrowingTree
from graspsense_c45.table import Table
from graspsense_c45.training_set import TrainingSet


def prune_reduced_error(tree: GrowingTree, training: TrainingSet, table: Table, held_out: Indices) -> None:
    """Make a leaf of every node that makes no more errors as a leaf than as a tree on the held-out rows of a table."""
    real_weights = table.weights[held_out]
    bits = bits_below(float(real_weights.sum()), WEIGHT_BITS)
    weights = np.rint(np.ldexp(real_weights, bits)).astype(np.int64)
    grown_weight = tree.counts.sum(axis=1)
    held = _held_out_counts(tree, grown_weight, (table.values[held_out], table.labels[held_out], weights))
    majority = training.majority_class(tree.counts)
    as_leaf = held.sum(axis=1) - held[np.arange(len(held)), majority]
    as_tree = as_leaf.copy()
    empty = training.real_weights(grown_weight) < TOLERANCE
    limit = np.ldexp(TOLERANCE, min(bits, 80))
    for level in reversed(tree.levels(ROOT)):
        inner = tree.inner(level)
        if not inner.size:
            continue
        children = tree.children(inner)
        parent = np.repeat(inner, tree.n_children[inner])
        # A branch without training weight predicts the class of its parent.
        of_branch = held[children].sum(axis=1) - held[children, majority[parent]]
        errors = np.where(empty[children], of_branch, as_tree[children])
        as_tree[inner] = sum_in_runs(errors, tree.n_children[inner])
        leaves = inner[as_leaf[inner] - as_tree[inner] < limit]
        tree.make_leaves(leaves)
        as_tree[leaves] = as_leaf[leaves]


def _held_out_counts(
    tree: GrowingTree, grown_weight: FixedPoint, held_out: tuple[Reals, Indices, FixedPoint]
) -> FixedPoint:
    """Return the weight of each class (nodes x classes) of held-out rows (values, labels, weights) at each node."""
    values, labels, weights = held_out
    n_classes = tree.counts.shape[1]
    held = np.zeros(tree.counts.shape, dtype=np.int64)
    rows, nodes = np.arange(len(labels)), np.zeros(len(labels), dtype=np.int64)
    while rows.size:
        key = nodes * n_classes + labels[rows]
        counts = np.bincount(key, weights=weights, minlength=held.size)
        held += counts.astype(np.int64).reshape(held.shape)
        inner = tree.feature[nodes] != LEAF
        rows, weights, nodes = to_children(
            tree, values, rows[inner], weights[inner], nodes[inner], grown_weight
        )
    return held
