"""Pessimistic pruning with subtree raising, from the leaves to the root.

Errors and estimates are kept in fixed point, so that the sums over leaves do not depend on the order.
Source: Quinlan, C4.5 (1993), chapter 4; weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.prune.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import FixedPoint, Indices
from graspsense_c45.estimates import Estimation, estimate, prepare_estimation
from graspsense_c45.routing import to_children
from graspsense_c45.splits import LEAF, GrowingTree
from graspsense_c45.training_set import TrainingSet

MOST_KEPT = 100_000
"""Number of estimates that are kept from one fit to the next."""

Entries = tuple[Indices, FixedPoint]
"""Rows, or parts of rows, with their fixed-point weights."""


def prune_pessimistic(tree: GrowingTree, training: TrainingSet) -> None:
    """Replace subtrees by leaves or by their heaviest branch where the estimated errors grow by no more than 0.1."""
    _Pruner(tree, training).prune()


@lru_cache(maxsize=8)
def _known_estimates(estimation: Estimation) -> dict[tuple[int, int], int]:
    """Return where estimates are kept from one fit to the next, by weight and errors; the same for equal settings."""
    del estimation
    return {}


class _Pruner:
    """A pessimistic pruning. `entries` holds the rows of each inner node, or their parts."""

    def __init__(self, tree: GrowingTree, training: TrainingSet) -> None:
        self._tree, self._training = tree, training
        self._estimation = prepare_estimation(
            training.options.confidence_factor, training.total_weight, training.scale.weight_bits
        )
        self._limit = self._estimation.limit
        self._known = _known_estimates(self._estimation)
        self._entries: dict[int, Entries] = {}
        self._as_leaf = self._estimates(tree.counts)
        self._as_tree = list(self._as_leaf)

    def prune(self) -> None:
        """Prune the whole tree."""
        rows = np.arange(len(self._training.labels))
        stack = self._descend(0, (rows, self._training.weights))
        # Children are above their parents on the stack.
        while stack:
            node = stack.pop()
            if self._prune_node(node):
                # The node has another split and other rows below it, so its whole subtree is pruned again.
                again = self._descend(node, self._entries[node])
                self._set_counts(again[1:])
                stack.extend(again)

    def _descend(self, root: int, entries: Entries) -> list[int]:
        """Send rows down from a node, and return its subtree."""
        tree, raising = self._tree, self._training.options.subtree_raising
        inside, stack = [], [root]
        self._entries[root] = entries
        while stack:
            node = stack.pop()
            inside.append(node)
            if tree.feature[node] == LEAF:
                continue
            eldest, number = int(tree.first_child[node]), int(tree.n_children[node])
            stack.extend(range(eldest, eldest + number))
            if raising:
                rows, weights = self._entries[node]
                rows, weights, nodes = self._to_children(node, rows, weights)
                for child in range(eldest, eldest + number):
                    here = nodes == child
                    self._entries[child] = (rows[here], weights[here])
        return inside

    def _to_children(
        self, node: int, rows: Indices, weights: FixedPoint
    ) -> tuple[Indices, FixedPoint, Indices]:
        start = np.full(len(rows), node)
        entries, parts, nodes = to_children(self._tree, self._training.values, rows, weights, start)
        return entries, parts, nodes

    def _set_counts(self, nodes: list[int]) -> None:
        """Set the counts and the estimates as leaves of these nodes from their rows."""
        if not nodes:
            return
        training, counts = self._training, self._tree.counts
        for node in nodes:
            rows, weights = self._entries[node]
            counts[node] = np.bincount(training.labels[rows], weights=weights, minlength=training.n_classes)
        for node, errors in zip(nodes, self._estimates(counts[nodes]), strict=True):
            self._as_leaf[node] = errors

    def _prune_node(self, node: int) -> bool:
        """Prune a node whose children are pruned; return whether its heaviest child has replaced it."""
        tree, as_leaf, as_tree = self._tree, self._as_leaf[node], self._as_tree
        as_tree[node] = as_leaf
        if tree.feature[node] == LEAF:
            return False
        eldest, number = int(tree.first_child[node]), int(tree.n_children[node])
        errors = sum(as_tree[eldest : eldest + number])
        as_tree[node] = errors
        if not self._training.options.subtree_raising:
            if criteria.is_no_worse(as_leaf, errors, self._limit):
                self._make_leaf(node)
            return False
        heavy = self._heaviest(eldest, number)
        as_branch = self._errors_as_branch(heavy, self._entries[node])
        if criteria.leaf_is_best(as_leaf, errors, as_branch, self._limit):
            self._make_leaf(node)
        elif criteria.is_no_worse(as_branch, errors, self._limit):
            tree.replace(np.array([node]), np.array([heavy]))
            return True
        return False

    def _make_leaf(self, node: int) -> None:
        self._tree.make_leaves(np.array([node]))
        self._as_tree[node] = self._as_leaf[node]

    def _heaviest(self, eldest: int, number: int) -> int:
        """Return the heaviest of these children, the last of those within the tolerance."""
        children = self._tree.counts[eldest : eldest + number].sum(axis=1)
        best, chosen = 0.0, eldest
        for child, weight in enumerate(self._training.real_weights(children).tolist(), eldest):
            if criteria.is_not_lighter(weight, best):
                best, chosen = weight, child
        return chosen

    def _errors_as_branch(self, heavy: int, entries: Entries) -> int:
        """Return the estimated errors of the heaviest branch with all rows of its parent sent through it."""
        tree, labels = self._tree, self._training.labels
        n_classes, result = self._training.n_classes, 0
        rows, weights = entries
        nodes = np.full(len(rows), heavy)
        while rows.size:
            ended = tree.feature[nodes] == LEAF
            if ended.any():
                leaves = nodes[ended]
                number = int(leaves.max()) + 1
                key = leaves * n_classes + labels[rows[ended]]
                counts = np.bincount(key, weights=weights[ended], minlength=number * n_classes)
                counts = counts.reshape(number, n_classes)[np.bincount(leaves) > 0]
                result += sum(self._estimates(counts.astype(np.int64)))
            going = ~ended
            rows, weights, nodes = to_children(
                tree, self._training.values, rows[going], weights[going], nodes[going]
            )
        return result

    def _estimates(self, counts: FixedPoint) -> list[int]:
        """Return the estimated errors of leaves with these counts (leaves x classes); each is computed once."""
        totals = counts.sum(axis=1)
        pairs = list(zip(totals.tolist(), self._training.training_errors(counts).tolist(), strict=True))
        new = list(dict.fromkeys(pair for pair in pairs if pair not in self._known))
        if len(self._known) > MOST_KEPT:
            self._known.clear()
            new = list(dict.fromkeys(pairs))
        if new:
            weights, errors = np.array(new, dtype=np.int64).T
            estimated = np.asarray(estimate(weights, errors, self._estimation)).tolist()
            self._known.update(zip(new, estimated, strict=True))
        return [self._known[pair] for pair in pairs]
