"""Collapsing and pessimistic pruning, node by node from the leaves to the root.

Source: Quinlan, C4.5 (1993), chapter 4; weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from graspsense_c45.arithmetic import first_maximum, real_weight
from graspsense_c45.arrays import FixedPoint, Indices, Integer
from graspsense_c45.criteria import collapses, is_no_worse, is_not_lighter, leaf_is_best
from graspsense_c45.depthfirst.nodes import (
    Nodes,
    RowIndices,
    Rows,
    leaf_below,
    list_subtree,
    make_leaf,
    weight_of,
)
from graspsense_c45.estimates import Estimation, estimate
from graspsense_c45.splits import LEAF


class Errors(NamedTuple):
    """Estimated errors of each node, as a leaf and as a tree, in fixed point.

    joining: nodes x (classes + 1), the weight that joins each leaf, by class and in all; zeros between two uses.
    """

    as_leaf: FixedPoint
    as_tree: FixedPoint
    joining: FixedPoint


class PruningSpace(NamedTuple):
    """Arrays that are written before they are read; the first three have an entry per node, the others one per row.

    listed: the nodes of a subtree. waiting: those to prune. joined: leaves that rows of another branch join.
    rows, leaves: the rows of a subtree, and the leaf of each.
    """

    listed: Indices
    waiting: Indices
    joined: Indices
    rows: RowIndices
    leaves: Indices


class Pruning(NamedTuple):
    """The constants of pessimistic pruning.

    estimation: of errors. margin: the largest difference of weights that count as equal, in fixed point.
    raising: whether the heaviest branch may replace its parent.
    """

    estimation: Estimation
    margin: Integer
    raising: bool


def collapse(nodes: Nodes, errors: FixedPoint, margin: Integer, slack: float) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node as a leaf.

    errors: written for each node.

    `nodewise.collapsing.collapse` does the same; `tests/test_engines.py` checks that both agree to the bit.
    """
    # Every node has a lower index than its children. Nodes below a new leaf are no longer reached.
    for node in range(len(nodes.feature) - 1, -1, -1):
        as_leaf = training_errors(nodes.counts[node], margin)
        errors[node] = as_leaf
        if nodes.feature[node] != LEAF:
            left = nodes.first_child[node]
            errors[node] = errors[left] + errors[left + 1]
            if collapses(errors[node], as_leaf, slack):
                make_leaf(node, nodes)


def prune(nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, workspace: PruningSpace) -> None:
    """Replace subtrees by leaves or by their heaviest branch where the estimated errors grow by no more than 0.1.

    `nodewise.pruning.prune_pessimistic` does the same; `tests/test_engines.py` checks that both agree to the bit.
    """
    n_waiting = enter_subtree(np.int64(0), np.int64(0), nodes, pruning, errors, workspace)
    # Children are above their parents on the stack.
    while n_waiting > 0:
        n_waiting -= 1
        node = workspace.waiting[n_waiting]
        if prune_node(node, nodes, rows, pruning, errors, workspace.joined):
            # The node has another split and other rows below it, so its whole subtree is pruned again.
            reassign_rows(node, nodes, rows, workspace)
            n_waiting = enter_subtree(node, n_waiting, nodes, pruning, errors, workspace)


def enter_subtree(
    root: Integer, n_waiting: Integer, nodes: Nodes, pruning: Pruning, errors: Errors, workspace: PruningSpace
) -> Integer:
    """Estimate all nodes below a root as leaves, and add them to the waiting ones; return the number of these."""
    number = list_subtree(nodes, root, workspace.listed)
    for i in range(number):
        node = workspace.listed[i]
        errors.as_leaf[node] = estimate_leaf(nodes.counts[node], pruning)
        workspace.waiting[n_waiting + i] = node
    return n_waiting + number


def prune_node(
    node: Integer, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, joined: Indices
) -> bool:
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
    as_branch = as_tree[heavy] + increase(node, heavy, nodes, rows, pruning, errors, joined)
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
    return weight_of(counts) - int(counts[first_maximum(counts, np.int64(0), margin)])


def estimate_leaf(counts: FixedPoint, pruning: Pruning) -> Integer:
    """Return the estimated errors of a leaf with these counts."""
    errors: Integer = estimate(weight_of(counts), training_errors(counts, pruning.margin), pruning.estimation)
    return errors


def heaviest_child(left: Integer, nodes: Nodes, weight_bits: Integer) -> Integer:
    """Return the heavier one of the children `left` and `left + 1`, the second one of equals."""
    best, chosen = 0.0, left
    for child in range(left, left + 2):
        weight = real_weight(weight_of(nodes.counts[child]), weight_bits)
        if is_not_lighter(weight, best):
            best, chosen = weight, child
    return chosen


def increase(
    node: Integer, heavy: Integer, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, joined: Indices
) -> Integer:
    """Return by how much the estimates of the heaviest child's leaves grow when the node's other rows join them."""
    joining, n_classes = errors.joining, nodes.counts.shape[1]
    n_joined = np.int64(0)
    for part in range(2):
        begin = nodes.start[node] if part == 0 else nodes.end[heavy]
        stop = nodes.start[heavy] if part == 0 else nodes.end[node]
        for i in range(begin, stop):
            row = rows.order[i]
            leaf = leaf_below(nodes, heavy, rows.values, row)
            # A leaf is noted when the first weight joins it; a row of weight 0 changes nothing.
            if rows.weights[row] > 0:
                if joining[leaf, n_classes] == 0:
                    joined[n_joined] = leaf
                    n_joined += 1
                joining[leaf, n_classes] += rows.weights[row]
                joining[leaf, rows.labels[row]] += rows.weights[row]
    result = np.int64(0)
    for i in range(n_joined):
        leaf = joined[i]
        counts = nodes.counts[leaf]
        for k in range(n_classes):
            counts[k] += joining[leaf, k]
        result += estimate_leaf(counts, pruning) - errors.as_leaf[leaf]
        for k in range(n_classes):
            counts[k] -= joining[leaf, k]
            joining[leaf, k] = 0
        joining[leaf, n_classes] = 0
    return result


def reassign_rows(root: Integer, nodes: Nodes, rows: Rows, workspace: PruningSpace) -> None:
    """Send the rows of a node down to the leaves below it; set intervals and counts of all nodes on the way."""
    begin, stop = nodes.start[root], nodes.end[root]
    number, n_classes = list_subtree(nodes, root, workspace.listed), nodes.counts.shape[1]
    below, own, leaf_of = workspace.listed[:number], workspace.rows, workspace.leaves
    for node in below:
        nodes.end[node] = 0
        for k in range(n_classes):
            nodes.counts[node, k] = 0
    for i in range(stop - begin):
        row = rows.order[begin + i]
        leaf = leaf_below(nodes, root, rows.values, row)
        own[i], leaf_of[i] = row, leaf
        nodes.end[leaf] += 1
        nodes.counts[leaf, rows.labels[row]] += rows.weights[row]
    lay_out(below, nodes, begin, stop)
    for node in below:
        if nodes.feature[node] == LEAF:
            nodes.end[node] = nodes.start[node]
    for i in range(stop - begin):
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
            for k in range(nodes.counts.shape[1]):
                nodes.counts[node, k] = nodes.counts[left, k] + nodes.counts[left + 1, k]
    nodes.start[below[0]], nodes.end[below[0]] = begin, stop
    for node in below:
        if nodes.feature[node] != LEAF:
            left = nodes.first_child[node]
            nodes.start[left] = nodes.start[node]
            nodes.end[left] += nodes.start[left]
            nodes.start[left + 1] = nodes.end[left]
            nodes.end[left + 1] += nodes.start[left + 1]
