"""A finished tree: a value."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arithmetic import TOLERANCE, Array
from graspsense_c45.branches import LEAF, Branches, Tests
from graspsense_c45.schema import Attribute, Schema


@dataclass(frozen=True, eq=False)
class Tree:
    """A tree that predicts; it does not change, and equal trees compare equal.

    schema: columns and classes. tests: the nodes, numbered breadth first, the sons of a node one after the other.
    weights: float64, nodes x classes, the training weight that came to each node.
    laplace: whether distributions are smoothed at the leaves.
    """

    schema: Schema
    tests: Tests
    weights: NDArray[np.float64]
    laplace: bool = False

    def __post_init__(self) -> None:
        """Make the arrays read-only."""
        for array in (*self._columns(), self.weights):
            array.flags.writeable = False

    def __eq__(self, other: object) -> bool:
        """Equal to the bit."""
        if not isinstance(other, Tree):
            return NotImplemented
        pairs = zip((*self._columns(), self.weights), (*other._columns(), other.weights), strict=True)
        return (
            self.schema == other.schema
            and self.laplace == other.laplace
            and all(
                mine.shape == theirs.shape and mine.tobytes() == theirs.tobytes() for mine, theirs in pairs
            )
        )

    def __hash__(self) -> int:
        """Equal trees have equal hashes."""
        return hash((self.schema, self.laplace, self.tests.attribute.tobytes(), self.weights.tobytes()))

    def __repr__(self) -> str:
        """Size and classes in one line."""
        return f"<Tree: {self.n_leaves} leaves, {self.n_nodes} nodes, {len(self.schema.classes)} classes>"

    @property
    def n_nodes(self) -> int:
        """Number of nodes, leaves included (J48's size of the tree)."""
        return len(self.tests.attribute)

    @property
    def n_leaves(self) -> int:
        """Number of leaves."""
        return int(np.count_nonzero(self.tests.attribute == LEAF))

    @cached_property
    def depth(self) -> int:
        """Tests on the longest path."""
        return len(self.tests.levels(np.zeros(1, dtype=np.int64))) - 1

    @cached_property
    def weight(self) -> NDArray[np.float64]:
        """Training weight at each node."""
        return np.asarray(self.weights.sum(axis=1))

    @cached_property
    def majority(self) -> NDArray[np.int64]:
        """The class of each node: the first one not beaten by more than the tolerance."""
        return first_maximum(self.weights)

    @cached_property
    def parent(self) -> NDArray[np.int64]:
        """The parent of each node, -1 at the root."""
        inner = np.flatnonzero(self.tests.attribute != LEAF)
        parent = np.full(self.n_nodes, -1)
        parent[self.tests.sons(inner)] = np.repeat(inner, self.tests.n_sons[inner])
        return parent

    def attribute(self, node: int) -> Attribute:
        """The attribute an inner node tests."""
        return self.schema.attributes[int(self.tests.attribute[node])]

    def sons(self, node: int) -> range:
        """The sons of a node; none at a leaf."""
        first = int(self.tests.first_son[node])
        return range(first, first + int(self.tests.n_sons[node]))

    def is_leaf(self, node: int) -> bool:
        """Whether the node tests nothing."""
        return bool(self.tests.attribute[node] == LEAF)

    def to_dict(self) -> dict[str, Any]:
        """Nested nodes: n, dist, class, and att, thr, bags, sons at inner ones.

        thr is the threshold of a numeric test; at a nominal one it is None (one son a value) or the index of the value
        that goes to the first son. class is the index of the majority class, bags the weight of each son.
        """
        nodes: list[dict[str, Any]] = [
            {"n": n, "dist": dist, "class": majority}
            for n, dist, majority in zip(
                self.weight.tolist(), self.weights.tolist(), self.majority.tolist(), strict=True
            )
        ]
        for i in np.flatnonzero(self.tests.attribute != LEAF).tolist():
            threshold: float | int | None = float(self.tests.threshold[i])
            if self.attribute(i).is_nominal:
                value = int(self.tests.value[i])
                threshold = None if value < 0 else value
            sons = [nodes[son] for son in self.sons(i)]
            nodes[i] |= {
                "att": int(self.tests.attribute[i]),
                "thr": threshold,
                "bags": [son["n"] for son in sons],
                "sons": sons,
            }
        return nodes[0]

    def _columns(self) -> tuple[NDArray[Any], ...]:
        tests = self.tests
        return tests.attribute, tests.threshold, tests.value, tests.first_son, tests.n_sons


def first_maximum(rows: Array) -> NDArray[np.int64]:
    """The first column of each row that no later one beats by more than the tolerance (scanning as J48 does)."""
    best = np.full(len(rows), -1.0)
    chosen = np.zeros(len(rows), dtype=np.int64)
    for k in range(rows.shape[1]):
        better = rows[:, k] - best > TOLERANCE
        best = np.where(better, rows[:, k], best)
        chosen = np.where(better, k, chosen)
    return chosen


def finish(branches: Branches, weight_bits: int, schema: Schema, laplace: bool) -> Tree:
    """The tree value of what was grown and pruned; nodes that are no longer reached are gone."""
    order = np.concatenate(branches.levels(np.zeros(1, dtype=np.int64)))
    n_sons = branches.n_sons[order]
    first_son = np.where(n_sons > 0, 1 + np.cumsum(n_sons) - n_sons, 0).astype(np.int32)
    tests = Tests(
        branches.attribute[order], branches.threshold[order], branches.value[order], first_son, n_sons
    )
    return Tree(schema, tests, np.ldexp(branches.counts[order].astype(np.float64), -weight_bits), laplace)
