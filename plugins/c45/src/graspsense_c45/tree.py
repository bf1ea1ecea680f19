"""A fitted tree, as a value: its nodes in flat arrays, of which the children of a node have consecutive indices."""

from __future__ import annotations

from functools import cached_property
from typing import Any

import numpy as np
from attrs import define, frozen

from graspsense_c45.arithmetic import LN2, TOLERANCE, x_ln_x
from graspsense_c45.arrays import AnyArray, Indices, NodeColumn, Reals
from graspsense_c45.table import Attribute, Schema

LEAF = -1
"""The feature of a leaf."""
ALL_VALUES = -1
"""The category of a nominal split with one child for each value, and of every other node."""
ROOT = np.zeros(1, dtype=np.int64)
"""The root as an array of nodes."""


@define(eq=False)
class Splits:
    """How the nodes of a tree split, one entry per node; node 0 is the root.

    feature: the attribute that is tested, -1 at a leaf.
    threshold: of a numeric test, in the unit of the attribute; a value at most this large goes to the first child. NaN
        at other nodes.
    category: of a nominal test of one value against the others, the index of the value that goes to the first child;
        -1 where each value has a child of its own, and at other nodes.
    first_child, n_children: the children are ``first_child`` to ``first_child + n_children - 1``.
    """

    feature: NodeColumn
    threshold: Reals
    category: NodeColumn
    first_child: NodeColumn
    n_children: NodeColumn

    def children(self, nodes: Indices) -> Indices:
        """Return all children of these nodes, in the order of the nodes."""
        return ranges(self.first_child[nodes], self.n_children[nodes])

    def levels(self, roots: Indices) -> list[Indices]:
        """Return the nodes at depth 0, 1, ... below these roots."""
        levels = []
        nodes = roots
        while nodes.size:
            levels.append(nodes)
            nodes = self.children(nodes)
        return levels

    def slot(self, nodes: Indices, tested: Reals) -> Indices:
        """Return the child that each value goes to, counted from 0; -1 where the value is missing.

        `tested` holds, for each of the nodes, a value of the node's feature.
        """
        nominal = np.isnan(self.threshold[nodes])
        slots = (tested > self.threshold[nodes]).astype(np.int64)
        if nominal.any():
            with np.errstate(invalid="ignore"):
                code = tested[nominal].astype(np.int64)
            category = self.category[nodes][nominal]
            slots[nominal] = np.where(category == ALL_VALUES, code, code != category)
        slots[np.isnan(tested)] = -1
        return slots


@frozen(eq=False, repr=False, slots=False)
class Tree:
    """A tree that predicts. It does not change, and trees that are equal to the bit compare equal.

    schema: attributes and classes.
    splits: how the nodes split. Nodes are numbered breadth first.
    class_weights: nodes x classes, the training weight of each class at each node.
    laplace: whether probabilities are smoothed at the leaves.
    """

    schema: Schema
    splits: Splits
    class_weights: Reals
    laplace: bool = False

    def __attrs_post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (*self._columns(), self.class_weights):
            array.flags.writeable = False

    def __eq__(self, other: object) -> bool:
        """Return whether the other tree is the same to the bit."""
        if not isinstance(other, Tree):
            return NotImplemented
        pairs = zip(
            (*self._columns(), self.class_weights), (*other._columns(), other.class_weights), strict=True
        )
        return (
            self.schema == other.schema
            and self.laplace == other.laplace
            and all(
                mine.shape == theirs.shape and mine.tobytes() == theirs.tobytes() for mine, theirs in pairs
            )
        )

    def __hash__(self) -> int:
        """Return the same number for equal trees."""
        return hash((self.schema, self.laplace, self.splits.feature.tobytes(), self.class_weights.tobytes()))

    def __repr__(self) -> str:
        """Return the size and the number of classes."""
        return f"<Tree: {self.n_leaves} leaves, {self.node_count} nodes, {len(self.schema.classes)} classes>"

    @property
    def node_count(self) -> int:
        """Number of nodes, leaves included: the size of the tree in J48's report."""
        return len(self.splits.feature)

    @property
    def n_leaves(self) -> int:
        """Number of leaves."""
        return int(np.count_nonzero(self.splits.feature == LEAF))

    @cached_property
    def max_depth(self) -> int:
        """Number of tests on the longest path."""
        return len(self.splits.levels(ROOT)) - 1

    @cached_property
    def weighted_n_node_samples(self) -> Reals:
        """Training weight at each node."""
        return np.asarray(self.class_weights.sum(axis=1))

    @cached_property
    def majority_class(self) -> Indices:
        """The class of each node: the first one that no other exceeds by more than the tolerance.

        A leaf without training weight has that of its parent.
        """
        chosen = largest_class(self.class_weights)
        chosen[self.empty] = chosen[self.parent[self.empty]]
        return chosen

    @cached_property
    def empty(self) -> Indices:
        """The leaves without training weight, as of a nominal value that no row has."""
        return np.flatnonzero((self.weighted_n_node_samples < TOLERANCE) & (self.parent >= 0))

    @cached_property
    def parent(self) -> Indices:
        """The parent of each node, -1 at the root."""
        inner = np.flatnonzero(self.splits.feature != LEAF)
        parent = np.full(self.node_count, -1)
        parent[self.splits.children(inner)] = np.repeat(inner, self.splits.n_children[inner])
        return parent

    def attribute(self, node: int) -> Attribute:
        """Return the attribute that an inner node tests."""
        return self.schema.attributes[int(self.splits.feature[node])]

    def children(self, node: int) -> range:
        """Return the children of a node; a leaf has none."""
        eldest = int(self.splits.first_child[node])
        return range(eldest, eldest + int(self.splits.n_children[node]))

    def is_leaf(self, node: int) -> bool:
        """Return whether the node is a leaf."""
        return bool(self.splits.feature[node] == LEAF)

    def to_dict(self) -> dict[str, Any]:
        """Return the nodes as nested dictionaries.

        Every node has ``weighted_n_node_samples``, ``class_weights`` and ``class`` (the index of its majority class).
        An inner node also has ``feature``, ``threshold``, ``child_weights`` and ``children``. ``threshold`` is a number
        in the unit of the attribute; at a nominal test it is None where each value has a child, else the index of the
        value that goes to the first child.
        """
        nodes: list[dict[str, Any]] = [
            {"weighted_n_node_samples": weight, "class_weights": weights, "class": majority}
            for weight, weights, majority in zip(
                self.weighted_n_node_samples.tolist(),
                self.class_weights.tolist(),
                self.majority_class.tolist(),
                strict=True,
            )
        ]
        for node in np.flatnonzero(self.splits.feature != LEAF).tolist():
            threshold: float | int | None = float(self.splits.threshold[node])
            if self.attribute(node).is_nominal:
                category = int(self.splits.category[node])
                threshold = None if category < 0 else category
            children = [nodes[child] for child in self.children(node)]
            nodes[node] |= {
                "feature": int(self.splits.feature[node]),
                "threshold": threshold,
                "child_weights": [child["weighted_n_node_samples"] for child in children],
                "children": children,
            }
        return nodes[0]

    def _columns(self) -> tuple[AnyArray, ...]:
        splits = self.splits
        return splits.feature, splits.threshold, splits.category, splits.first_child, splits.n_children


def largest_class(rows: Reals) -> Indices:
    """Return `arithmetic.first_maximum` of each row, as J48 finds the class of a distribution."""
    largest, chosen = np.full(len(rows), -1.0), np.zeros(len(rows), dtype=np.int64)
    for k in range(rows.shape[1]):
        better = rows[:, k] - largest > TOLERANCE
        largest[better] = rows[better, k]
        chosen[better] = k
    return chosen


def ranges(starts: AnyArray, lengths: AnyArray) -> Indices:
    """Return the integers of several ranges, one range after the other."""
    ends = lengths.cumsum(dtype=np.int64)
    if not ends.size:
        return ends
    result: Indices = (starts + lengths - ends).repeat(lengths)
    result += np.arange(ends[-1])
    return result


def first_children(n_children: AnyArray) -> AnyArray:
    """Return the first child of each node of a tree that is numbered breadth first; 0 at leaves."""
    eldest = 1 + np.cumsum(n_children) - n_children
    return np.where(n_children > 0, eldest, 0).astype(np.int32)


def feature_importances(tree: Tree) -> Reals:
    """Return the fraction of each attribute in the information gain of the tree on its training weight.

    The fractions add up to 1; all are 0 where the tree gains no information. The impurity of a node is its entropy.
    """
    classes = np.array([[x_ln_x(weight) for weight in row] for row in tree.class_weights.tolist()]).sum(
        axis=1
    )
    whole = np.array([x_ln_x(weight) for weight in tree.weighted_n_node_samples.tolist()])
    weighted_impurity = (whole - classes) / LN2
    gained = np.zeros(len(tree.schema.attributes))
    for node in range(tree.node_count):
        if not tree.is_leaf(node):
            children = list(tree.children(node))
            gained[tree.splits.feature[node]] += weighted_impurity[node] - weighted_impurity[children].sum()
    gained = np.maximum(gained, 0.0)
    return np.asarray(gained / gained.sum() if gained.any() else gained)
