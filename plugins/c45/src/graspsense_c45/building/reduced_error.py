"""Reduced-error pruning: a subtree becomes a leaf where that makes no more errors on held-out rows.

Source: Quinlan, Simplifying decision trees, Int. J. Man-Machine Studies 27 (1987); weka.classifiers.trees.j48 3.9.6,
PruneableClassifierTree.
"""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arithmetic import TOLERANCE, first_maximum, real_weight
from graspsense_c45.arrays import Integers, IntegerTable
from graspsense_c45.building.descent import (
    Descent,
    Rows,
    count_classes,
    enter_child,
    last_on_path,
    start_at_root,
)
from graspsense_c45.building.nodes import Nodes, make_leaf, weight_of


class HeldOutErrors(NamedTuple):
    """The constants of reduced-error pruning, and what is written for each node.

    weight_bits, margin: of the weights that the tree was grown on, in fixed point. limit: the least number of errors
    that counts, in the fixed point of the held-out rows. counts: their weight by class. as_tree: their errors.
    """

    weight_bits: int
    margin: int
    limit: float
    counts: IntegerTable
    as_tree: Integers


def prune_reduced_error(nodes: Nodes, rows: Rows, errors: HeldOutErrors, descent: Descent) -> bool:
    """Make a leaf of every node that makes no more errors as a leaf than as a tree on held-out rows.

    Return whether there were enough entries; if not, the nodes are not right.
    """
    start_at_root(rows, descent)
    count_classes(0, errors.counts[0], rows, descent)
    while descent.length[0] > 0 and not descent.lacking[0]:
        node = last_on_path(descent)
        if descent.entered[node] < nodes.n_children[node]:
            child = enter_child(node, True, nodes, rows, descent)
            count_classes(child, errors.counts[child], rows, descent)
        else:
            prune_node(node, nodes, errors)
            descent.length[0] -= 1
    return not descent.lacking[0]


def prune_node(node: int, nodes: Nodes, errors: HeldOutErrors) -> None:
    """Prune a node whose children are pruned."""
    majority = first_maximum(nodes.counts[node], 0, errors.margin)
    as_leaf = errors_of_class(majority, errors.counts[node])
    errors.as_tree[node] = as_leaf
    if nodes.n_children[node] == 0:
        return
    below, eldest = 0, nodes.first_child[node]
    for child in range(eldest, eldest + nodes.n_children[node]):
        if real_weight(weight_of(nodes.counts[child]), errors.weight_bits) < TOLERANCE:
            # A branch without training weight predicts the class of its parent.
            below += errors_of_class(majority, errors.counts[child])
        else:
            below += errors.as_tree[child]
    if as_leaf - below < errors.limit:
        make_leaf(node, nodes)
    else:
        errors.as_tree[node] = below


def errors_of_class(majority: int, counts: Integers) -> int:
    """Return the weight of the other classes."""
    return weight_of(counts) - int(counts[majority])
