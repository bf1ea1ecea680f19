"""The nodes of a tree in flat arrays; the children of a node have consecutive indices."""

from __future__ import annotations

import numpy as np
from attrs import define

from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, NodeColumn, Reals

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


@define(eq=False)
class GrowingTree(Splits):
    """A tree while it is grown and pruned. counts: nodes x classes, the fixed-point weight at each node."""

    counts: FixedPoint


def ranges(starts: AnyArray, lengths: AnyArray) -> Indices:
    """Return the integers of several ranges, one range after the other."""
    ends = lengths.cumsum(dtype=np.int64)
    if not ends.size:
        return ends
    result: Indices = (starts + lengths - ends).repeat(lengths)
    result += np.arange(ends[-1])
    return result
