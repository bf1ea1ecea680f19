"""Pessimistic pruning with subtree raising.

Errors and estimates are kept in fixed point, so that the sums over leaves do not depend on the order.
Source: Quinlan, C4.5 (1993), chapter 4; weka.classifiers.trees.j48 3.9.6, C45PruneableClassifierTree.prune.
"""

from __future__ import annotations

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arrays import FixedPoint, Indices, NodeColumn
from graspsense_c45.estimates import estimate, prepare_estimation
from graspsense_c45.levelwise.collapsing import sum_over_children
from graspsense_c45.routing import leaves_of_rows, to_children
from graspsense_c45.splits import LEAF, ROOT, GrowingTree
from graspsense_c45.training_set import TrainingSet


def prune_pessimistic(tree: GrowingTree, training: TrainingSet, leaf_of_row: NodeColumn) -> None:
    """Replace subtrees by leaves or by their heaviest branch where the estimated errors grow by no more than 0.1.

    `depthfirst.pruning.prune` does the same to a tree without missing values; `tests/test_engines.py` checks that
    both agree to the bit.
    """
    pruner = _Pruner(tree, training, leaf_of_row)
    rows = np.arange(len(training.labels))
    if training.complete:
        pruner.prune_complete(ROOT, rows)
    else:
        pruner.prune_entries(ROOT, rows, training.weights, np.zeros(len(rows), dtype=np.int64))


class _Pruner:
    """A pessimistic pruning. It prunes below several roots at once, since a raised branch is pruned again."""

    def __init__(self, tree: GrowingTree, training: TrainingSet, leaf_of_row: NodeColumn) -> None:
        self._tree, self._training, self._leaf_of_row = tree, training, leaf_of_row
        self._estimation = prepare_estimation(
            training.options.confidence_factor, training.total_weight, training.scale.weight_bits
        )
        self._limit = self._estimation.limit
        n_nodes = len(tree.feature)
        self._as_leaf = self._estimate(tree.counts)
        self._as_tree = self._as_leaf.copy()
        self._depth = np.full(n_nodes, -1, dtype=np.int32)
        self._parent = np.zeros(n_nodes, dtype=np.int32)

    def prune_complete(self, roots: Indices, rows: Indices) -> None:
        """Prune below these roots, given their rows; each row is at one leaf only."""
        tree, raising = self._tree, self._training.options.subtree_raising
        levels = self._number(roots)
        at = self._leaf_of_row[rows]
        self._sum_up(levels[-1])
        for depth in range(len(levels) - 2, -1, -1):
            inner = self._sum_up(levels[depth])
            if not raising:
                self._cut(
                    inner[criteria.is_no_worse(self._as_leaf[inner], self._as_tree[inner], self._limit)]
                )
                continue
            below = np.flatnonzero(self._depth[at] == depth + 1)
            child = at[below]
            owner = self._parent[child]
            at[below] = owner
            heavy = self._heaviest_child(inner)
            heavy_of = self._scatter(inner, heavy)
            other = heavy_of[owner] != child
            others, others_owner = rows[below[other]], owner[other]
            leaf = leaves_of_rows(tree, self._training.values, others, heavy_of[others_owner])
            labels, weights = self._training.labels[others], self._training.weights[others]
            increase = self._increase(leaf, labels, weights, others_owner)[inner]
            as_branch = self._as_tree[heavy] + increase
            leaves, raised = self._decide(inner, as_branch)
            flag = np.zeros(len(tree.feature), dtype=np.int8)
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

    def prune_entries(self, roots: Indices, rows: Indices, weights: FixedPoint, nodes: Indices) -> None:
        """Prune below these roots, given their rows with weights; below the roots a row may be in parts."""
        tree, values = self._tree, self._training.values
        levels = self._number(roots)
        entries = []
        while True:
            inner = tree.feature[nodes] != LEAF
            rows, weights, nodes = rows[inner], weights[inner], nodes[inner]
            entries.append((rows, weights, nodes))
            if len(entries) == len(levels):
                break
            rows, weights, nodes = to_children(tree, values, rows, weights, nodes)
            self._set_counts(levels[len(entries)], rows, weights, nodes)
        self._sum_up(levels[-1])
        for depth in range(len(levels) - 2, -1, -1):
            inner = self._sum_up(levels[depth])
            if not self._training.options.subtree_raising:
                self._cut(
                    inner[criteria.is_no_worse(self._as_leaf[inner], self._as_tree[inner], self._limit)]
                )
                continue
            rows, weights, nodes = entries[depth]
            heavy = self._heaviest_child(inner)
            heavy_of = self._scatter(inner, heavy)
            here = tree.feature[nodes] != LEAF
            rows, weights, nodes = rows[here], weights[here], nodes[here]
            as_branch = self._reapplied(rows, weights, nodes, heavy_of)[inner]
            leaves, raised = self._decide(inner, as_branch)
            self._cut(leaves)
            if raised.size:
                tree.replace(raised, heavy_of[raised])
                flag = np.zeros(len(tree.feature), dtype=bool)
                flag[raised] = True
                again = flag[nodes]
                self.prune_entries(raised, rows[again], weights[again], nodes[again])
                self._depth[levels[depth]] = depth

    def _number(self, roots: Indices) -> list[Indices]:
        """Return the levels below the roots; note the depth and the parent of every node."""
        tree = self._tree
        levels = tree.levels(roots)
        for depth, nodes in enumerate(levels):
            self._depth[nodes] = depth
            inner = tree.inner(nodes)
            self._parent[tree.children(inner)] = np.repeat(inner, tree.n_children[inner])
        return levels

    def _sum_up(self, nodes: Indices) -> Indices:
        """Set the estimates of the nodes as trees from those of their children; return the inner nodes."""
        inner = self._tree.inner(nodes)
        self._as_tree[nodes] = self._as_leaf[nodes]
        self._as_tree[inner] = sum_over_children(self._tree, inner, self._as_tree)
        return inner

    def _cut(self, leaves: Indices) -> None:
        self._tree.make_leaves(leaves)
        self._as_tree[leaves] = self._as_leaf[leaves]

    def _decide(self, inner: Indices, as_branch: FixedPoint) -> tuple[Indices, Indices]:
        """Return which inner nodes become leaves, and which are replaced by their heaviest child."""
        as_leaf, as_tree = self._as_leaf[inner], self._as_tree[inner]
        leaf = criteria.leaf_is_best(as_leaf, as_tree, as_branch, self._limit)
        branch = np.logical_not(leaf) & criteria.is_no_worse(as_branch, as_tree, self._limit)
        return inner[leaf], inner[branch]

    def _heaviest_child(self, inner: Indices) -> Indices:
        """Return the heaviest child of each node, the last of those within the tolerance."""
        tree = self._tree
        weight = (
            self._training.real_weights(tree.counts.sum(axis=1))
            if inner.size * 8 > len(tree.counts)
            else None
        )
        best = np.zeros(len(inner))
        chosen = tree.first_child[inner].astype(np.int64)
        for slot in range(int(tree.n_children[inner].max(initial=0))):
            has = tree.n_children[inner] > slot
            child = tree.first_child[inner] + np.where(has, slot, 0)
            child_weight = (
                self._training.real_weights(tree.counts[child].sum(axis=1))
                if weight is None
                else weight[child]
            )
            better = has & criteria.is_not_lighter(child_weight, best)
            best = np.where(better, child_weight, best)
            chosen = np.where(better, child, chosen)
        return chosen

    def _scatter(self, nodes: Indices, numbers: Indices) -> Indices:
        """Return an array over all nodes that holds these numbers at these nodes, and -1 elsewhere."""
        by_node = np.full(len(self._tree.feature), -1)
        by_node[nodes] = numbers
        return by_node

    def _estimate(self, counts: FixedPoint) -> FixedPoint:
        errors = self._training.training_errors(counts)
        return np.asarray(estimate(counts.sum(axis=1), errors, self._estimation))

    def _increase(self, leaf: Indices, labels: Indices, weights: FixedPoint, owner: Indices) -> FixedPoint:
        """Return by how much the estimates of leaves grow when these rows join them, summed by owner.

        The result is indexed by node.
        """
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
        increase = self._estimate(counts) - self._as_leaf[leaves]
        return np.bincount(owner_of_leaf, weights=increase, minlength=n_nodes).astype(np.int64)

    def _reapplied(self, rows: Indices, weights: FixedPoint, nodes: Indices, heavy_of: Indices) -> FixedPoint:
        """Return the estimate of the heaviest branch of each node, with all rows of the node sent through it."""
        tree, training = self._tree, self._training
        n_nodes, n_classes = tree.counts.shape
        result = np.zeros(n_nodes, dtype=np.int64)
        owner_of = np.zeros(n_nodes, dtype=np.int64)
        owner_of[heavy_of[nodes]] = nodes
        nodes = heavy_of[nodes]
        while rows.size:
            ended = tree.feature[nodes] == LEAF
            leaves, number = np.unique(nodes[ended], return_inverse=True)
            key = number * n_classes + training.labels[rows[ended]]
            counts = np.bincount(key, weights=weights[ended], minlength=len(leaves) * n_classes)
            estimates = self._estimate(counts.astype(np.int64).reshape(-1, n_classes))
            result += np.bincount(owner_of[leaves], weights=estimates, minlength=n_nodes).astype(np.int64)
            going = ~ended
            parents = np.unique(nodes[going])
            owner_of[tree.children(parents)] = np.repeat(owner_of[parents], tree.n_children[parents])
            rows, weights, nodes = to_children(
                tree, training.values, rows[going], weights[going], nodes[going]
            )
        return result

    def _recount(self, roots: Indices, rows: Indices) -> None:
        """Set the counts and estimates below the roots from the leaves of the rows."""
        tree, training = self._tree, self._training
        n_classes = tree.counts.shape[1]
        levels = tree.levels(roots)
        nodes = np.concatenate(levels)
        number = self._scatter(nodes, np.arange(len(nodes)))
        key = number[self._leaf_of_row[rows]] * n_classes + training.labels[rows]
        counts = np.bincount(key, weights=training.weights[rows], minlength=len(nodes) * n_classes)
        tree.counts[nodes] = counts.astype(np.int64).reshape(-1, n_classes)
        for level in reversed(levels):
            inner = tree.inner(level)
            if inner.size:
                children = tree.children(inner)
                runs = np.cumsum(tree.n_children[inner]) - tree.n_children[inner]
                tree.counts[inner] = np.add.reduceat(tree.counts[children], runs, axis=0)
        self._as_leaf[nodes] = self._estimate(tree.counts[nodes])

    def _set_counts(self, level: Indices, rows: Indices, weights: FixedPoint, nodes: Indices) -> None:
        tree, training = self._tree, self._training
        n_classes = tree.counts.shape[1]
        number = self._scatter(level, np.arange(len(level)))
        key = number[nodes] * n_classes + training.labels[rows]
        counts = np.bincount(key, weights=weights, minlength=len(level) * n_classes)
        tree.counts[level] = counts.astype(np.int64).reshape(-1, n_classes)
        self._as_leaf[level] = self._estimate(tree.counts[level])
