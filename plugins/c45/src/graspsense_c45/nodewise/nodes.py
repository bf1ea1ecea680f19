"""The rows at one node while a tree is grown, and the nodes that were made so far."""

from __future__ import annotations

import numpy as np
from attrs import define, field

from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, Mask
from graspsense_c45.splits import ALL_VALUES, LEAF, GrowingTree


@define(eq=False)
class NodeRows:
    """The rows at a node, or the parts of rows with missing values.

    rows, weights: each row once, with its fixed-point weight here. order: numeric attributes x rows, the same rows
    sorted by each attribute; those without a value come last.
    """

    rows: Indices
    weights: FixedPoint
    order: Indices

    def child(self, entries: Indices, weights: FixedPoint, scratch: Mask) -> NodeRows:
        """Return the rows with these places in `rows`, with their weights in a child.

        `scratch` has an entry for each row of the table, all of them false, as they are again afterwards.
        """
        rows = self.rows[entries]
        scratch[rows] = True
        order = self.order[scratch[self.order]].reshape(len(self.order), len(rows))
        scratch[rows] = False
        return NodeRows(rows, weights, order)


@define(eq=False)
class NodeList:
    """The nodes of a tree that grows. The children of a node follow each other."""

    counts: list[FixedPoint]
    feature: list[int] = field(factory=list)
    threshold: list[float] = field(factory=list)
    category: list[int] = field(factory=list)
    first_child: list[int] = field(factory=list)
    n_children: list[int] = field(factory=list)

    def __attrs_post_init__(self) -> None:
        """Make leaves of the nodes with these counts."""
        self._add_leaves(len(self.counts))

    def split(self, node: int, split: tuple[int, float, int], counts: AnyArray) -> int:
        """Split a node by feature, threshold and category; return the first of its children, which are leaves."""
        eldest, number = len(self.counts), len(counts)
        self.feature[node], self.threshold[node], self.category[node] = split
        self.first_child[node], self.n_children[node] = eldest, number
        self.counts.extend(counts)
        self._add_leaves(number)
        return eldest

    def tree(self) -> GrowingTree:
        """Return the nodes as a tree."""
        return GrowingTree(
            feature=np.array(self.feature, dtype=np.int32),
            threshold=np.array(self.threshold),
            category=np.array(self.category, dtype=np.int32),
            first_child=np.array(self.first_child, dtype=np.int32),
            n_children=np.array(self.n_children, dtype=np.int32),
            counts=np.array(self.counts),
        )

    def _add_leaves(self, number: int) -> None:
        self.feature.extend([LEAF] * number)
        self.threshold.extend([np.nan] * number)
        self.category.extend([ALL_VALUES] * number)
        self.first_child.extend([0] * number)
        self.n_children.extend([0] * number)
