"""Nodes in flat arrays, the sons of a node always numbered in a row."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arithmetic import Array

LEAF = -1
ALL_VALUES = -1


@dataclass(slots=True)
class Tests:
    """What the nodes of a tree ask, in flat arrays; node 0 is the root.

    Node i tests ``attribute[i]`` (-1: a leaf) and has the sons ``first_son[i]`` to ``first_son[i] + n_sons[i] - 1``.
    threshold: numeric test, ``<=`` goes to the first son; NaN elsewhere. value: nominal test of one value against the
    rest (the value goes to the first son), or -1 for one son a value.
    """

    attribute: NDArray[np.int32]
    threshold: NDArray[np.float64]
    value: NDArray[np.int32]
    first_son: NDArray[np.int32]
    n_sons: NDArray[np.int32]

    def inner(self, nodes: Array) -> Array:
        """Those of the nodes that are no leaves."""
        chosen: Array = nodes[self.attribute[nodes] != LEAF]
        return chosen

    def sons(self, nodes: Array) -> Array:
        """All sons of these nodes, in the order of the nodes."""
        return ranges(self.first_son[nodes], self.n_sons[nodes])

    def levels(self, roots: Array) -> list[Array]:
        """The nodes at depth 0, 1, ... below these roots."""
        found = []
        nodes = roots
        while nodes.size:
            found.append(nodes)
            nodes = self.sons(nodes)
        return found

    def slot(self, nodes: Array, tested: Array) -> Array:
        """Which son a value goes to, counted from 0; -1 where it is missing. ``tested`` is in the node's attribute."""
        nominal = np.isnan(self.threshold[nodes])
        slots = (tested > self.threshold[nodes]).astype(np.int64)
        if nominal.any():
            with np.errstate(invalid="ignore"):
                code = tested[nominal].astype(np.int64)
            one = self.value[nodes][nominal]
            slots[nominal] = np.where(one == ALL_VALUES, code, code != one)
        slots[np.isnan(tested)] = -1
        return slots


@dataclass(slots=True)
class Branches(Tests):
    """A tree while it is grown and pruned. counts: int64, nodes x classes, fixed-point weight."""

    counts: NDArray[np.int64]

    def make_leaves(self, nodes: Array) -> None:
        """Cut everything below these nodes."""
        self.attribute[nodes] = LEAF
        self.threshold[nodes] = np.nan
        self.value[nodes] = ALL_VALUES
        self.first_son[nodes] = 0
        self.n_sons[nodes] = 0

    def replace(self, nodes: Array, by: Array) -> None:
        """Let each node test what another one tests, and have its sons; its own counts stay."""
        for column in (self.attribute, self.threshold, self.value, self.first_son, self.n_sons):
            column[nodes] = column[by]


def ranges(starts: Array, lengths: Array) -> Array:
    """The integers of several ranges, one range after the other."""
    ends = lengths.cumsum(dtype=np.int64)
    if not ends.size:
        return ends
    result: Array = (starts + lengths - ends).repeat(lengths)
    result += np.arange(ends[-1])
    return result
