"""Collapsing: subtrees that hardly save training errors become leaves.

Source: weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.collapse.
"""

from __future__ import annotations

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import AnyArray, FixedPoint, Indices
from graspsense_c45.splits import LEAF, ROOT, GrowingTree
from graspsense_c45.training_set import TrainingSet


def collapse(tree: GrowingTree, training: TrainingSet) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node as a leaf."""
    errors = training.training_errors(tree.counts)
    below = errors.copy()
    for nodes in reversed(tree.levels(ROOT)):
        inner = tree.inner(nodes)
        below[inner] = sum_over_children(tree, inner, below)
    cut = np.asarray(criteria.collapses(below, errors, training.collapse_slack)) & (tree.feature != LEAF)
    tree.make_leaves(np.flatnonzero(cut))


def sum_over_children(tree: GrowingTree, inner: Indices, of_nodes: FixedPoint) -> FixedPoint:
    """Return, for each of these inner nodes, the sum of a quantity over its children."""
    return sum_in_runs(of_nodes[tree.children(inner)], tree.n_children[inner])


def sum_in_runs(numbers: FixedPoint, lengths: AnyArray) -> FixedPoint:
    """Return the sums of consecutive runs of these lengths, none of which is 0."""
    if not len(lengths):
        return np.zeros(0, dtype=np.int64)
    return np.add.reduceat(numbers, np.cumsum(lengths) - lengths)
