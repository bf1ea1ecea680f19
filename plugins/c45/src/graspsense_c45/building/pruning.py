"""Collapsing and pessimistic pruning, node by node from the leaves to the root.

Source: Quinlan, C4.5 (1993), chapter 4; weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.
"""

from __future__ import annotations

from typing import NamedTuple

from graspsense_c45.arithmetic import real_weight
from graspsense_c45.arrays import Integers
from graspsense_c45.building.descent import (
    Descent,
    Rows,
    add_to_path,
    count_classes,
    enter_child,
    last_on_path,
    move_others,
    start_at_root,
)
from graspsense_c45.building.nodes import Nodes, make_leaf, replace, training_errors, weight_of
from graspsense_c45.criteria import collapses, is_no_worse, is_not_lighter, leaf_is_best
from graspsense_c45.estimates import Estimation, estimate


class Errors(NamedTuple):
    """Errors of each node, as a leaf and as a tree, in fixed point. counts: an entry for each class, to work with."""

    as_leaf: Integers
    as_tree: Integers
    counts: Integers


class Pruning(NamedTuple):
    """The constants of pessimistic pruning.

    estimation: of errors. margin: the largest difference of weights that count as equal, in fixed point.
    raising: whether the heaviest branch may replace its parent.
    """

    estimation: Estimation
    margin: int
    raising: bool


def collapse(nodes: Nodes, errors: Integers, margin: int, slack: float) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node as a leaf.

    errors: written for each node.
    """
    # Every node has a lower index than its children. Nodes below a new leaf are no longer reached.
    for node in range(len(nodes.feature) - 1, -1, -1):
        as_leaf = training_errors(nodes.counts[node], margin)
        errors[node] = as_leaf
        if nodes.n_children[node]:
            errors[node] = sum_over_children(node, nodes, errors)
            if collapses(errors[node], as_leaf, slack):
                make_leaf(node, nodes)


def sum_over_children(node: int, nodes: Nodes, numbers: Integers) -> int:
    """Return the sum of these numbers of the nodes over the children of one."""
    total, eldest = 0, nodes.first_child[node]
    for child in range(eldest, eldest + nodes.n_children[node]):
        total += numbers[child]
    return total


def prune(nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, descent: Descent) -> bool:
    """Replace subtrees by leaves or by their heaviest branch where the estimated errors grow by no more than 0.1.

    Return whether there were enough entries; if not, the nodes are not right.
    """
    start_at_root(rows, descent)
    errors.as_leaf[0] = estimate_leaf(nodes.counts[0], pruning)
    while descent.length[0] > 0 and not descent.lacking[0]:
        node = last_on_path(descent)
        if descent.entered[node] < nodes.n_children[node]:
            child = enter_child(node, pruning.raising, nodes, rows, descent)
            if pruning.raising:
                # They differ from those of growing below a branch that has replaced its parent.
                count_classes(child, nodes.counts[child], rows, descent)
            errors.as_leaf[child] = estimate_leaf(nodes.counts[child], pruning)
        elif prune_node(node, nodes, rows, pruning, errors, descent):
            # The node has another split and other rows below it, so its whole subtree is pruned again.
            descent.entered[node] = 0
        else:
            descent.length[0] -= 1
    return not descent.lacking[0]


def prune_node(
    node: int, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, descent: Descent
) -> bool:
    """Prune the node at the end of the path, below which all is; return whether its heaviest child has replaced it."""
    as_leaf, as_tree, limit = errors.as_leaf, errors.as_tree, pruning.estimation.limit
    as_tree[node] = as_leaf[node]
    if nodes.n_children[node] == 0:
        return False
    as_tree[node] = sum_over_children(node, nodes, as_tree)
    if not pruning.raising:
        if is_no_worse(as_leaf[node], as_tree[node], limit):
            make_leaf(node, nodes)
            as_tree[node] = as_leaf[node]
        return False
    heavy = heaviest_child(node, nodes, pruning.estimation.weight_bits)
    as_branch = errors_as_branch(node, heavy, nodes, rows, pruning, errors, descent)
    if leaf_is_best(as_leaf[node], as_tree[node], as_branch, limit):
        make_leaf(node, nodes)
        as_tree[node] = as_leaf[node]
        return False
    if not is_no_worse(as_branch, as_tree[node], limit):
        return False
    replace(node, heavy, nodes)
    return True


def estimate_leaf(counts: Integers, pruning: Pruning) -> int:
    """Return the estimated errors of a leaf with these counts."""
    return estimate(weight_of(counts), training_errors(counts, pruning.margin), pruning.estimation)


def heaviest_child(node: int, nodes: Nodes, weight_bits: int) -> int:
    """Return the heaviest child of a node, the last one of equals."""
    eldest = nodes.first_child[node]
    best, chosen = 0.0, eldest
    for child in range(eldest, eldest + nodes.n_children[node]):
        weight = real_weight(weight_of(nodes.counts[child]), weight_bits)
        if is_not_lighter(weight, best):
            best, chosen = weight, child
    return int(chosen)


def errors_as_branch(
    parent: int, heavy: int, nodes: Nodes, rows: Rows, pruning: Pruning, errors: Errors, descent: Descent
) -> int:
    """Return the estimated errors of a child of the node at the end of the path, with all rows of that node."""
    length, result = descent.length[0], 0
    if rows.complete:
        # Those of the child stay where they are.
        move_others(parent, heavy, nodes, rows, descent)
    else:
        descent.begin[heavy], descent.stop[heavy] = descent.begin[parent], descent.stop[parent]
    add_to_path(heavy, descent)
    while descent.length[0] > length:
        node = last_on_path(descent)
        if descent.begin[node] == descent.stop[node]:
            result += errors.as_tree[node] if rows.complete else 0
            descent.length[0] -= 1
        elif descent.entered[node] < nodes.n_children[node]:
            enter_child(node, pruning.raising, nodes, rows, descent)
        else:
            if nodes.n_children[node] == 0:
                result += estimate_leaf(counts_with_rows(node, nodes, rows, errors.counts, descent), pruning)
            descent.length[0] -= 1
    return int(result)


def counts_with_rows(node: int, nodes: Nodes, rows: Rows, counts: Integers, descent: Descent) -> Integers:
    """Write and return the weight of each class among the rows of a leaf on the path, and those that stay there."""
    count_classes(node, counts, rows, descent)
    if rows.complete:
        for k in range(len(counts)):
            counts[k] += nodes.counts[node][k]
    return counts
