"""Collapsing: subtrees that hardly save training errors become leaves.

Source: weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.collapse.
"""

from __future__ import annotations

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, Mask, NodeColumn
from graspsense_c45.splits import LEAF, ROOT, GrowingTree
from graspsense_c45.training_set import TrainingSet


def collapse(tree: GrowingTree, training: TrainingSet, leaf_of_row: NodeColumn) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node as a leaf.

    The leaf of each row is updated. `depthfirst.pruning.collapse` does the same to a tree; `tests/test_engines.py`
    checks that both agree to the bit.
    """
    errors = training.training_errors(tree.counts)
    below = errors.copy()
    for nodes in reversed(tree.levels(ROOT)):
        inner = tree.inner(nodes)
        below[inner] = sum_over_children(tree, inner, below)
    slack = float(np.ldexp(criteria.COLLAPSE_SLACK, training.scale.weight_bits))
    _cut(tree, np.asarray(criteria.collapses(below, errors, slack)), leaf_of_row)


def sum_over_children(tree: GrowingTree, inner: Indices, of_nodes: FixedPoint) -> FixedPoint:
    """Return, for each of these inner nodes, the sum of a quantity over its children."""
    return sum_in_runs(of_nodes[tree.children(inner)], tree.n_children[inner])


def sum_in_runs(numbers: FixedPoint, lengths: AnyArray) -> FixedPoint:
    """Return the sums of consecutive runs of these lengths, none of which is 0."""
    if not len(lengths):
        return np.zeros(0, dtype=np.int64)
    return np.add.reduceat(numbers, np.cumsum(lengths) - lengths)


def _cut(tree: GrowingTree, flagged: Mask, leaf_of_row: NodeColumn) -> None:
    """Make leaves of the flagged inner nodes, which get the rows of all nodes below."""
    top = np.arange(len(tree.feature))
    for nodes in tree.levels(ROOT):
        inner = tree.inner(nodes)
        children = tree.children(inner)
        parent = np.repeat(inner, tree.n_children[inner])
        covered = flagged[parent] | (top[parent] != parent)
        top[children] = np.where(covered, top[parent], children)
    tree.make_leaves(np.flatnonzero(flagged & (tree.feature != LEAF)))
    leaf_of_row[:] = top[leaf_of_row]
