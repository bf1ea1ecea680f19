"""Collapsing and pessimistic pruning, node by node from the leaves to the root.

Source: Quinlan, C4.5 (1993), chapter 4; weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import first_maximum, real_weight
from graspsense_c45.arrays import FixedPoint, Indices, Integer
from graspsense_c45.criteria import collapses, is_no_worse, is_not_lighter, leaf_is_best
from graspsense_c45.depthfirst.nodes import Nodes, Rows, leaf_below, make_leaf, no_nodes, subtree
from graspsense_c45.estimates import Estimation, estimate
from graspsense_c45.splits import LEAF


class Errors(NamedTuple):
    """Estimated errors of each node, as a leaf and as a tree, in fixed point.

    joining: nodes x (classes + 1), the weight that joins each leaf, by class and in all; zeros between two uses.
    """

    as_leaf: FixedPoint
    as_tree: FixedPoint
    joining: FixedPoint


class Pruning(NamedTuple):
    """The constants of pessimistic pruning.

    estimation: of errors. margin: the largest difference of weights that count as equal, in fixed point.
    raising: whether the heaviest branch may replace its parent.
    """

    estimation: Estimation
    margin: Integer
    raising: bool


def collapse(nodes: Nodes, margin: Integer, slack: float) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node as a leaf.

    `nodewise.collapsing.collapse` does the same; `tests/test_engines.py` checks that both agree to the bit.
    """
    # Every node has a lower index than its children. Nodes below a new leaf are no longer reached.
    errors = np.zeros(len(nodes.feature), dtype=np.int64)
    for node in range(len(nodes.feature) - 1, -1, -1):
        as_leaf = training_errors(nodes.counts[node], margin)
        errors[node] = as_leaf
        if nodes.feature[node] != LEAF:
            left = nodes.first_child[node]
            errors[node] = errors[left] + errors[left + 1]
            if collapses(errors[node], as_leaf, slack):
                make_leaf(node, nodes)


def prune(nodes: Nodes, rows: Rows, pruning: Pruning) -> None:
    """Replace subtrees by leaves or by their heaviest branch where the estimated errors grow by no more than 0.1.

    `nodewise.pruning.prune_pessimistic` does the same; `tests/test_engines.py` checks that both agree to the bit.
    """
    n_nodes, n_classes = nodes.counts.shape
    errors = Errors(
        np.zeros(n_nodes, dtype=np.int64),
        np.zeros(n_nodes, dtype=np.int64),
        np.zeros((n_nodes, n_classes + 1), dtype=np.int64),
    )
    stack = no_nodes()
    for node in subtree(nodes, 0):
        errors.as_leaf[node] = estimate_leaf(nodes.counts[node], pruning)
        stack.append(node)
    # Children are above their parents on the stack.
    while len(stack) > 0:
        node = stack.pop()
        if prune_node(node, nodes, rows, pruning, errors):
            # The node has another split and other rows below it, so its whole subtree is pruned again.
            again = subtree(nodes, node)
            reassign_rows(again, nodes, rows)
            for below in again:
                errors.as_leaf[below] = estimate_leaf(nodes.counts[below], pruning)
                stack.append(below)


def prune_node(node: Integer, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors) -> bool:
    """Prune a node whose children are pruned; return whether its heaviest child has replaced it."""
    as_leaf, as_tree, limit = errors.as_leaf, errors.as_tree, pruning.estimation.limit
    as_tree[node] = as_leaf[node]
    if nodes.feature[node] == LEAF:
        return False
    left = np.int64(nodes.first_child[node])
    as_tree[node] = as_tree[left] + as_tree[left + 1]
    if not pruning.raising:
        if is_no_worse(as_leaf[node], as_tree[node], limit):
            make_leaf(node, nodes)
            as_tree[node] = as_leaf[node]
        return False
    heavy = heaviest_child(left, nodes, pruning.estimation.weight_bits)
    as_branch = as_tree[heavy] + increase(node, heavy, nodes, rows, pruning, errors)
    if leaf_is_best(as_leaf[node], as_tree[node], as_branch, limit):
        make_leaf(node, nodes)
        as_tree[node] = as_leaf[node]
        return False
    if not is_no_worse(as_branch, as_tree[node], limit):
        return False
    nodes.feature[node] = nodes.feature[heavy]
    nodes.threshold[node] = nodes.threshold[heavy]
    nodes.first_child[node] = nodes.first_child[heavy]
    return True


def training_errors(counts: FixedPoint, margin: Integer) -> Integer:
    """Return the weight outside the majority class."""
    errors: Integer = counts.sum() - counts[first_maximum(counts, np.int64(0), margin)]
    return errors


def estimate_leaf(counts: FixedPoint, pruning: Pruning) -> Integer:
    """Return the estimated errors of a leaf with these counts."""
    errors: Integer = estimate(counts.sum(), training_errors(counts, pruning.margin), pruning.estimation)
    return errors


def heaviest_child(left: Integer, nodes: Nodes, weight_bits: Integer) -> Integer:
    """Return the heavier one of the children `left` and `left + 1`, the second one of equals."""
    best, chosen = 0.0, left
    for child in range(left, left + 2):
        weight = real_weight(nodes.counts[child].sum(), weight_bits)
        if is_not_lighter(weight, best):
            best, chosen = weight, child
    return chosen


def increase(
    node: Integer, heavy: Integer, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors
) -> Integer:
    """Return by how much the estimates of the heaviest child's leaves grow when the node's other rows join them."""
    joining = errors.joining
    touched = no_nodes()
    for part in range(2):
        begin = nodes.start[node] if part == 0 else nodes.end[heavy]
        stop = nodes.start[heavy] if part == 0 else nodes.end[node]
        for i in range(begin, stop):
            row = rows.order[i]
            leaf = np.int64(leaf_below(nodes, heavy, rows.values, row))
            # A leaf is noted when the first weight joins it; a row of weight 0 changes nothing.
            if rows.weights[row] > 0:
                if joining[leaf, -1] == 0:
                    touched.append(leaf)
                joining[leaf, -1] += rows.weights[row]
                joining[leaf, rows.labels[row]] += rows.weights[row]
    result = np.int64(0)
    for leaf in touched:
        result += estimate_leaf(nodes.counts[leaf] + joining[leaf, :-1], pruning) - errors.as_leaf[leaf]
        joining[leaf, :] = 0
    return result


def reassign_rows(below: Indices, nodes: Nodes, rows: Rows) -> None:
    """Send the rows of the first of these nodes down to its leaves; set intervals and counts of all of them."""
    begin, stop = nodes.start[below[0]], nodes.end[below[0]]
    own = rows.order[begin:stop].copy()
    leaf_of = np.empty(len(own), dtype=np.int64)
    for node in below:
        nodes.end[node] = 0
        nodes.counts[node, :] = 0
    for i in range(len(own)):
        leaf = leaf_below(nodes, below[0], rows.values, own[i])
        leaf_of[i] = leaf
        nodes.end[leaf] += 1
        nodes.counts[leaf, rows.labels[own[i]]] += rows.weights[own[i]]
    lay_out(below, nodes, begin, stop)
    for node in below:
        if nodes.feature[node] == LEAF:
            nodes.end[node] = nodes.start[node]
    for i in range(len(own)):
        leaf = leaf_of[i]
        rows.order[nodes.end[leaf]] = own[i]
        nodes.end[leaf] += 1


def lay_out(below: Indices, nodes: Nodes, begin: Integer, stop: Integer) -> None:
    """Set the intervals and counts of these nodes; `end` holds the number of rows of each leaf, and `counts` theirs."""
    for i in range(len(below) - 1, -1, -1):
        node = below[i]
        if nodes.feature[node] != LEAF:
            left = nodes.first_child[node]
            nodes.end[node] = nodes.end[left] + nodes.end[left + 1]
            nodes.counts[node] = nodes.counts[left] + nodes.counts[left + 1]
    nodes.start[below[0]], nodes.end[below[0]] = begin, stop
    for node in below:
        if nodes.feature[node] != LEAF:
            left = nodes.first_child[node]
            nodes.start[left] = nodes.start[node]
            nodes.end[left] += nodes.start[left]
            nodes.start[left + 1] = nodes.end[left]
            nodes.end[left + 1] += nodes.start[left + 1]
