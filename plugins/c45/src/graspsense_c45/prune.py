"""Cutting a grown tree back: collapse, pessimistic pruning with subtree raising, reduced-error pruning.

Errors and estimates are kept in fixed point, so that sums over leaves have no order.
Source: weka.classifiers.trees.j48 3.9.6 (C45PruneableClassifierTree, PruneableClassifierTree).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE, Array, bits_below
from graspsense_c45.branches import Branches
from graspsense_c45.descent import reach, step
from graspsense_c45.estimates import estimated_errors, prepare_confidence
from graspsense_c45.grow import majority_class
from graspsense_c45.problem import WEIGHT_BITS, Problem


def collapse(tree: Branches, problem: Problem, leaf_of_row: NDArray[np.int32]) -> None:
    """Make a leaf of every node whose subtree makes hardly fewer training errors than the node itself would."""
    errors = training_errors(tree.counts, problem)
    levels = tree.levels(np.zeros(1, dtype=np.int64))
    below = errors.copy()
    for nodes in reversed(levels):
        inner = tree.inner(nodes)
        below[inner] = _sum_over_sons(tree, inner, below)
    slack = np.ldexp(criteria.COLLAPSE_SLACK, problem.weight_bits)
    _cut(tree, below >= errors - slack, leaf_of_row)


def prune_reduced_error(
    tree: Branches, problem: Problem, values: NDArray[np.float64], labels: Array, real_weights: Array
) -> None:
    """Make a leaf of every node that does no worse than its subtree on held-out rows."""
    bits = bits_below(float(real_weights.sum()), WEIGHT_BITS)
    weights = np.rint(np.ldexp(real_weights, bits)).astype(np.int64)
    n_nodes, n_classes = tree.counts.shape
    grown_weight = tree.counts.sum(axis=1)
    held = np.zeros((n_nodes, n_classes), dtype=np.int64)
    rows, nodes = np.arange(len(labels)), np.zeros(len(labels), dtype=np.int64)
    while rows.size:
        key = nodes * n_classes + labels[rows]
        held += np.bincount(key, weights=weights, minlength=held.size).astype(np.int64).reshape(held.shape)
        inner = tree.attribute[nodes] != -1
        rows, weights, nodes = step(tree, values, rows[inner], weights[inner], nodes[inner], grown_weight)
    majority = majority_class(tree.counts, problem)
    as_leaf = held.sum(axis=1) - held[np.arange(n_nodes), majority]
    as_tree = as_leaf.copy()
    empty = problem.real_weights(grown_weight) < TOLERANCE
    limit = np.ldexp(TOLERANCE, bits)
    for level in reversed(tree.levels(np.zeros(1, dtype=np.int64))):
        inner = tree.inner(level)
        if not inner.size:
            continue
        sons = tree.sons(inner)
        parent = np.repeat(inner, tree.n_sons[inner])
        # A branch that no training row took answers with its parent's class.
        of_branch = held[sons].sum(axis=1) - held[sons, majority[parent]]
        errors = np.where(empty[sons], of_branch, as_tree[sons])
        as_tree[inner] = _sum_in_runs(errors, tree.n_sons[inner])
        leaves = inner[as_leaf[inner] - as_tree[inner] < limit]
        tree.make_leaves(leaves)
        as_tree[leaves] = as_leaf[leaves]


def prune_pessimistic(tree: Branches, problem: Problem, leaf_of_row: NDArray[np.int32]) -> None:
    """Replace subtrees by leaves or by their heaviest branch where estimated errors grow by no more than 0.1."""
    pruner = _Pruner(tree, problem, leaf_of_row)
    root = np.zeros(1, dtype=np.int64)
    rows = np.arange(len(problem.labels))
    if problem.complete:
        pruner.prune_complete(root, rows)
    else:
        pruner.prune_entries(root, rows, problem.weights, np.zeros(len(rows), dtype=np.int64))


def training_errors(counts: Array, problem: Problem) -> NDArray[np.int64]:
    """Weight outside the majority class, for each row of counts."""
    majority = majority_class(counts, problem)
    errors: NDArray[np.int64] = counts.sum(axis=1) - counts[np.arange(len(counts)), majority]
    return errors


def _sum_in_runs(numbers: Array, lengths: Array) -> NDArray[np.int64]:
    return (
        np.add.reduceat(numbers, np.cumsum(lengths) - lengths)
        if len(lengths)
        else np.zeros(0, dtype=np.int64)
    )


def _sum_over_sons(tree: Branches, inner: Array, numbers: Array) -> NDArray[np.int64]:
    return _sum_in_runs(numbers[tree.sons(inner)], tree.n_sons[inner])


def _cut(tree: Branches, flagged: Array, leaf_of_row: NDArray[np.int32]) -> None:
    """Make leaves of the flagged inner nodes, and let the rows below be theirs."""
    top = np.arange(len(tree.attribute))
    for nodes in tree.levels(np.zeros(1, dtype=np.int64)):
        inner = tree.inner(nodes)
        sons = tree.sons(inner)
        parent = np.repeat(inner, tree.n_sons[inner])
        covered = flagged[parent] | (top[parent] != parent)
        top[sons] = np.where(covered, top[parent], sons)
    tree.make_leaves(np.flatnonzero(flagged & (tree.attribute != -1)))
    leaf_of_row[:] = top[leaf_of_row]


class _Pruner:
    """One pessimistic pruning; works on forests, since a raised branch is pruned again."""

    def __init__(self, tree: Branches, problem: Problem, leaf_of_row: NDArray[np.int32]) -> None:
        self._tree, self._problem, self._leaf_of_row = tree, problem, leaf_of_row
        self._confidence = prepare_confidence(problem.options.confidence_factor)
        self._bits = bits_below(2.0 * float(problem.real_weights(problem.weights.sum())), WEIGHT_BITS)
        self._limit = int(np.ceil(np.ldexp(criteria.PRUNING_SLACK + TOLERANCE, self._bits)))
        n_nodes = len(tree.attribute)
        self._as_leaf = self._estimate(tree.counts)
        self._as_tree = self._as_leaf.copy()
        self._depth = np.full(n_nodes, -1, dtype=np.int32)
        self._parent = np.zeros(n_nodes, dtype=np.int32)

    def prune_complete(self, roots: Array, rows: Array) -> None:
        """Prune below these roots, which these rows have come to; each row is at one leaf only."""
        tree, raising = self._tree, self._problem.options.subtree_raising
        levels = self._number(roots)
        at = self._leaf_of_row[rows]
        self._sum_up(levels[-1])
        for depth in range(len(levels) - 2, -1, -1):
            inner = self._sum_up(levels[depth])
            if not raising:
                self._cut(inner[self._as_leaf[inner] - self._as_tree[inner] < self._limit])
                continue
            below = np.flatnonzero(self._depth[at] == depth + 1)
            son = at[below]
            owner = self._parent[son]
            at[below] = owner
            heavy = self._heaviest_son(inner)
            heavy_of = self._scatter(inner, heavy)
            other = heavy_of[owner] != son
            others, others_owner = rows[below[other]], owner[other]
            leaf = reach(tree, self._problem.values, others, heavy_of[others_owner])
            labels, weights = self._problem.labels[others], self._problem.weights[others]
            as_branch = self._as_tree[heavy] + self._growth(leaf, labels, weights, others_owner)[inner]
            leaves, raised = self._decide(inner, as_branch)
            flag = np.zeros(len(tree.attribute), dtype=np.int8)
            flag[leaves], flag[raised] = 1, 2
            fate = flag[owner]
            self._cut(leaves)
            cut = below[fate == 1]
            self._leaf_of_row[rows[cut]] = at[cut]
            if raised.size:
                moved = fate[other] == 2
                self._leaf_of_row[others[moved]] = leaf[moved]
                tree.replace(raised, heavy_of[raised])
                again = rows[below[fate == 2]]
                self._recount(raised, again)
                self.prune_complete(raised, again)
                self._depth[levels[depth]] = depth

    def prune_entries(self, roots: Array, rows: Array, weights: Array, nodes: Array) -> None:
        """Prune below these roots, given their rows with weights; below the roots rows may be in parts."""
        tree, values = self._tree, self._problem.values
        levels = self._number(roots)
        entries = []
        while True:
            inner = tree.attribute[nodes] != -1
            rows, weights, nodes = rows[inner], weights[inner], nodes[inner]
            entries.append((rows, weights, nodes))
            if len(entries) == len(levels):
                break
            rows, weights, nodes = step(tree, values, rows, weights, nodes)
            self._set_counts(levels[len(entries)], rows, weights, nodes)
        self._sum_up(levels[-1])
        for depth in range(len(levels) - 2, -1, -1):
            inner = self._sum_up(levels[depth])
            if not self._problem.options.subtree_raising:
                self._cut(inner[self._as_leaf[inner] - self._as_tree[inner] < self._limit])
                continue
            rows, weights, nodes = entries[depth]
            heavy = self._heaviest_son(inner)
            heavy_of = self._scatter(inner, heavy)
            here = tree.attribute[nodes] != -1
            rows, weights, nodes = rows[here], weights[here], nodes[here]
            as_branch = self._reapplied(rows, weights, nodes, heavy_of)[inner]
            leaves, raised = self._decide(inner, as_branch)
            self._cut(leaves)
            if raised.size:
                tree.replace(raised, heavy_of[raised])
                flag = np.zeros(len(tree.attribute), dtype=bool)
                flag[raised] = True
                again = flag[nodes]
                self.prune_entries(raised, rows[again], weights[again], nodes[again])
                self._depth[levels[depth]] = depth

    def _number(self, roots: Array) -> list[Array]:
        """The levels below the roots, with every node's depth and parent noted."""
        tree = self._tree
        levels = tree.levels(roots)
        for depth, nodes in enumerate(levels):
            self._depth[nodes] = depth
            inner = tree.inner(nodes)
            self._parent[tree.sons(inner)] = np.repeat(inner, tree.n_sons[inner])
        return levels

    def _sum_up(self, nodes: Array) -> Array:
        """Set the nodes' estimates as trees from their sons'; returns the inner ones."""
        inner = self._tree.inner(nodes)
        self._as_tree[nodes] = self._as_leaf[nodes]
        self._as_tree[inner] = _sum_over_sons(self._tree, inner, self._as_tree)
        return inner

    def _cut(self, leaves: Array) -> None:
        self._tree.make_leaves(leaves)
        self._as_tree[leaves] = self._as_leaf[leaves]

    def _decide(self, inner: Array, as_branch: Array) -> tuple[Array, Array]:
        """Those of the inner nodes that become leaves, and those that their heaviest son replaces."""
        as_leaf, as_tree = self._as_leaf[inner], self._as_tree[inner]
        leaf = (as_leaf - as_tree < self._limit) & (as_leaf - as_branch < self._limit)
        branch = ~leaf & (as_branch - as_tree < self._limit)
        return inner[leaf], inner[branch]

    def _heaviest_son(self, inner: Array) -> Array:
        """The heaviest son, the last of those within the tolerance."""
        tree = self._tree
        weight = (
            self._problem.real_weights(tree.counts.sum(axis=1)) if inner.size * 8 > len(tree.counts) else None
        )
        best = np.zeros(len(inner))
        chosen = tree.first_son[inner].astype(np.int64)
        for slot in range(int(tree.n_sons[inner].max(initial=0))):
            has = tree.n_sons[inner] > slot
            son = tree.first_son[inner] + np.where(has, slot, 0)
            son_weight = (
                self._problem.real_weights(tree.counts[son].sum(axis=1)) if weight is None else weight[son]
            )
            better = has & (best - son_weight < TOLERANCE)
            best = np.where(better, son_weight, best)
            chosen = np.where(better, son, chosen)
        return chosen

    def _scatter(self, nodes: Array, numbers: Array) -> Array:
        by_node = np.full(len(self._tree.attribute), -1)
        by_node[nodes] = numbers
        return by_node

    def _estimate(self, counts: Array) -> NDArray[np.int64]:
        problem = self._problem
        weight = problem.real_weights(counts.sum(axis=1))
        errors = problem.real_weights(training_errors(counts, problem))
        expected = estimated_errors(weight, errors, *self._confidence)
        return np.asarray(np.rint(np.ldexp(expected, self._bits)), dtype=np.int64)

    def _growth(self, leaf: Array, labels: Array, weights: Array, owner: Array) -> NDArray[np.int64]:
        """By how much the estimates of leaves grow when these rows join them, summed by owner (indexed by node)."""
        tree = self._tree
        n_nodes, n_classes = tree.counts.shape
        joined = np.zeros(n_nodes, dtype=bool)
        joined[leaf] = True
        leaves = np.flatnonzero(joined)
        number = self._scatter(leaves, np.arange(len(leaves)))
        added = np.bincount(
            number[leaf] * n_classes + labels, weights=weights, minlength=len(leaves) * n_classes
        )
        counts = tree.counts[leaves] + added.astype(np.int64).reshape(-1, n_classes)
        owner_of_leaf = np.zeros(len(leaves), dtype=np.int64)
        owner_of_leaf[number[leaf]] = owner
        growth = self._estimate(counts) - self._as_leaf[leaves]
        return np.bincount(owner_of_leaf, weights=growth, minlength=n_nodes).astype(np.int64)

    def _reapplied(self, rows: Array, weights: Array, nodes: Array, heavy_of: Array) -> NDArray[np.int64]:
        """The estimate of each owner's heaviest branch, all the owner's rows sent through it (indexed by node)."""
        tree, problem = self._tree, self._problem
        n_nodes, n_classes = tree.counts.shape
        result = np.zeros(n_nodes, dtype=np.int64)
        owner_of = np.zeros(n_nodes, dtype=np.int64)
        owner_of[heavy_of[nodes]] = nodes
        nodes = heavy_of[nodes]
        while rows.size:
            ended = tree.attribute[nodes] == -1
            leaves, number = np.unique(nodes[ended], return_inverse=True)
            key = number * n_classes + problem.labels[rows[ended]]
            counts = np.bincount(key, weights=weights[ended], minlength=len(leaves) * n_classes)
            estimates = self._estimate(counts.astype(np.int64).reshape(-1, n_classes))
            result += np.bincount(owner_of[leaves], weights=estimates, minlength=n_nodes).astype(np.int64)
            going = ~ended
            parents = np.unique(nodes[going])
            owner_of[tree.sons(parents)] = np.repeat(owner_of[parents], tree.n_sons[parents])
            rows, weights, nodes = step(tree, problem.values, rows[going], weights[going], nodes[going])
        return result

    def _recount(self, roots: Array, rows: Array) -> None:
        """Set the counts and estimates below the roots from the rows' leaves."""
        tree, problem = self._tree, self._problem
        n_classes = tree.counts.shape[1]
        levels = tree.levels(roots)
        nodes = np.concatenate(levels)
        number = self._scatter(nodes, np.arange(len(nodes)))
        key = number[self._leaf_of_row[rows]] * n_classes + problem.labels[rows]
        counts = np.bincount(key, weights=problem.weights[rows], minlength=len(nodes) * n_classes)
        tree.counts[nodes] = counts.astype(np.int64).reshape(-1, n_classes)
        for level in reversed(levels):
            inner = tree.inner(level)
            if inner.size:
                sons = tree.sons(inner)
                runs = np.cumsum(tree.n_sons[inner]) - tree.n_sons[inner]
                tree.counts[inner] = np.add.reduceat(tree.counts[sons], runs, axis=0)
        self._as_leaf[nodes] = self._estimate(tree.counts[nodes])

    def _set_counts(self, level: Array, rows: Array, weights: Array, nodes: Array) -> None:
        tree, problem = self._tree, self._problem
        n_classes = tree.counts.shape[1]
        number = self._scatter(level, np.arange(len(level)))
        key = number[nodes] * n_classes + problem.labels[rows]
        counts = np.bincount(key, weights=weights, minlength=len(level) * n_classes)
        tree.counts[level] = counts.astype(np.int64).reshape(-1, n_classes)
        self._as_leaf[level] = self._estimate(tree.counts[level])
