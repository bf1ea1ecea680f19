"""The level-wise layout for rows that all weigh 1 and miss nothing: only counting, and most of it once a level.

Every attribute keeps its row ids sorted by (node, value), and for each of them its place in a second layout, sorted by
(node, class, value). In that second layout the running class counts of every node are the same for all attributes, so
what moving a row from the right to the left side does to ``sum x ln x`` is computed once a level, and an attribute's
scan is a gather and a running sum. Passing to the sons keeps both orders, by selection alone; nothing is sorted again.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import Array
from graspsense_c45.branches import ALL_VALUES, ranges
from graspsense_c45.cuts import NOT_ADMISSIBLE, best_cuts
from graspsense_c45.grow import midpoints
from graspsense_c45.problem import Problem
from graspsense_c45.selection import Offers, offer_cuts, offer_values

JOINT_SIZE = 60_000
"""Attributes are worked on together while that many entries (attributes x rows) still fit the caches."""


@dataclass(slots=True)
class _Block:
    """Some numeric attributes (one a row of each array): row ids and values by (node, value), places by class."""

    attributes: NDArray[np.int64]
    rows: NDArray[np.int32]
    values: NDArray[np.float64]
    places: NDArray[np.int32]


class RowsOfOne:
    """A level of open nodes; ``leaf_of_row`` holds the node each row has come to."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        n = len(problem.labels)
        self._labels = problem.labels.astype(np.min_scalar_type(problem.n_classes))
        self._numeric = np.flatnonzero(problem.value_counts == 0)
        self._nominal = np.flatnonzero(problem.value_counts > 0)
        self._terms = problem.terms(np.arange(n + 1))
        self._step = np.diff(self._terms)
        self._blocks = [self._sorted_block(a) for a in self._numeric.tolist()]
        self._rows = np.arange(n, dtype=np.int32)
        self._counts = np.bincount(problem.labels, minlength=problem.n_classes)[None, :]
        self._n_nodes = 1
        self.leaf_of_row = np.zeros(n, dtype=np.int32)
        self._measure()

    def offers(self) -> Offers:
        """See ``grow.Level``."""
        problem = self._problem
        offers = Offers.none(len(problem.value_counts), len(self._sizes))
        self._share_levels_work()
        self._cut = np.full((len(problem.value_counts), len(self._sizes)), -1, dtype=np.int64)
        numerators = np.zeros(self._cut.shape, dtype=np.int64)
        n_cuts = np.zeros(self._cut.shape, dtype=np.int64)
        for block in self._blocks:
            cut, numerators[block.attributes], n_cuts[block.attributes] = self._scan(block)
            self._cut[block.attributes] = cut
        attribute, node = np.nonzero(self._cut >= 0)
        offer_cuts(
            offers,
            attribute,
            node,
            numerators[attribute, node],
            n_cuts[attribute, node],
            self._cut[attribute, node] + 1,
            self._sizes[node],
            self._sizes[node],
            problem,
        )
        for a in self._nominal.tolist():
            offer_values(offers, a, self._value_counts(a), self._sizes, problem)
        # Not needed any more, and as large as the rows.
        del self._steps, self._sides, self._inside, self._node
        return offers

    def thresholds(self, attribute: Array) -> NDArray[np.float64]:
        """See ``grow.Level``."""
        low, high = np.zeros(attribute.shape), np.full(attribute.shape, np.nan)
        for block in self._blocks:
            nodes, at = self._begins(block, attribute)
            at = at + self._cut[attribute[nodes], nodes]
            values = block.values.reshape(-1)
            low[nodes], high[nodes] = values[at], values[at + 1]
        return midpoints(low, high)

    def split(self, attribute: Array, value: Array, n_sons: Array) -> NDArray[np.int64]:
        """See ``grow.Level``."""
        problem = self._problem
        first_son = np.cumsum(n_sons) - n_sons
        n_all = int(n_sons.sum())
        self._slots = int(n_sons.max(initial=0))
        self._slot_of_row = np.zeros(len(problem.labels), dtype=np.min_scalar_type(self._slots))
        self._son_first, self._n_sons = first_son, n_sons
        counts = np.zeros(n_all * problem.n_classes, dtype=np.int64)
        for nodes, rows, slots in self._slots_of_rows(attribute, value):
            sons = np.repeat(first_son[nodes], self._sizes[nodes]) + slots
            self._slot_of_row[rows] = slots + 1
            self.leaf_of_row[rows] = self._n_nodes + sons
            counts += np.bincount(sons * problem.n_classes + self._labels[rows], minlength=len(counts))
        self._n_nodes += n_all
        self._son_counts = counts.reshape(n_all, problem.n_classes)
        return self._son_counts

    def descend(self, open_sons: NDArray[np.bool_]) -> Array:
        """See ``grow.Level``."""
        if not open_sons.any():
            return np.zeros(0, dtype=np.int64)
        # Slot 0 marks rows that have come to a leaf; slot s + 1 goes to son s.
        closed = np.flatnonzero(~open_sons)
        if closed.size:
            first = self._n_nodes - len(open_sons)
            reached = self.leaf_of_row - first
            done = reached >= 0
            done[done] = ~open_sons[reached[done]]
            self._slot_of_row[done] = 0
        kept = []
        for slot in range(self._slots):
            has = np.flatnonzero(self._n_sons > slot)
            sons = self._son_first[has] + slot
            kept.append(sons[open_sons[sons]])
        sons = np.concatenate(kept)
        for i, block in enumerate(self._blocks):
            self._blocks[i] = self._descend_block(block)
        slots = self._slot_of_row[self._rows]
        self._rows = np.concatenate([self._rows[slots == s + 1] for s in range(self._slots)])
        self._counts = self._son_counts[sons]
        del self._slot_of_row
        self._measure()
        self._join_blocks()
        return sons

    def _sorted_block(self, attribute: int) -> _Block:
        column = np.ascontiguousarray(self._problem.values[:, attribute])
        order = np.argsort(column).astype(np.int32)
        by_class = np.argsort(self._labels[order], kind="stable")
        places = np.empty(len(order), dtype=np.int32)
        places[by_class] = np.arange(len(order), dtype=np.int32)
        return _Block(np.array([attribute]), order[None, :], column[order][None, :], places[None, :])

    def _measure(self) -> None:
        self._sizes = self._counts.sum(axis=1)
        self._starts = np.cumsum(self._sizes) - self._sizes

    def _join_blocks(self) -> None:
        n = int(self._sizes.sum())
        if len(self._blocks) > 1 and n * len(self._numeric) <= JOINT_SIZE:
            self._blocks = [
                _Block(
                    np.concatenate([block.attributes for block in self._blocks]),
                    np.concatenate([block.rows for block in self._blocks]),
                    np.concatenate([block.values for block in self._blocks]),
                    np.concatenate([block.places for block in self._blocks]),
                )
            ]

    def _begins(self, block: _Block, attribute: Array) -> tuple[Array, Array]:
        """The nodes that split on an attribute of the block, and where their rows begin in its flattened arrays."""
        number = np.full(len(self._problem.value_counts) + 1, -1)
        number[block.attributes] = np.arange(len(block.attributes))
        place = number[attribute]
        nodes = np.flatnonzero(place >= 0)
        return nodes, place[nodes] * block.rows.shape[1] + self._starts[nodes]

    def _slots_of_rows(self, attribute: Array, value: Array) -> Iterator[tuple[Array, Array, Array]]:
        """Piece by piece: nodes that split, their rows (node by node), and the son each row goes to, counted from 0."""
        for block in self._blocks:
            nodes, begins = self._begins(block, attribute)
            if nodes.size:
                sizes = self._sizes[nodes]
                rows = block.rows.reshape(-1)[ranges(begins, sizes)]
                slots = np.ones(len(rows), dtype=np.int64)
                slots[ranges(np.cumsum(sizes) - sizes, self._cut[attribute[nodes], nodes] + 1)] = 0
                yield nodes, rows, slots
        for a in self._nominal.tolist():
            nodes = np.flatnonzero(attribute == a)
            if nodes.size:
                rows = self._rows[ranges(self._starts[nodes], self._sizes[nodes])]
                code = self._problem.values[rows, a].astype(np.int64)
                one = np.repeat(value[nodes], self._sizes[nodes])
                yield nodes, rows, np.where(one == ALL_VALUES, code, code != one)

    def _share_levels_work(self) -> None:
        """What one level needs once: the step of every place, the sides' terms of every position."""
        problem, sizes, starts = self._problem, self._sizes, self._starts
        n = int(sizes.sum())
        index = np.arange(n)
        class_sizes = self._counts.ravel()
        ends = np.cumsum(class_sizes)
        self._steps = self._step[index - np.repeat(ends - class_sizes, class_sizes)]
        self._steps -= self._step[np.repeat(ends - 1, class_sizes) - index]
        left = index - np.repeat(starts - 1, sizes)
        right = np.repeat(sizes, sizes) - left
        self._sides = self._terms[left]
        self._sides += self._terms[right]
        known = problem.real_weights(sizes)
        least_weight = criteria.min_side_weight(known, problem.n_classes, problem.options.min_objects)
        least = problem.units_at_least(least_weight)
        each = np.repeat(least, sizes)
        self._inside = (left >= each) & (right >= each)
        self._sides[~self._inside] = -NOT_ADMISSIBLE
        self._n_inside = np.maximum(sizes - 2 * least + 1, 0)
        self._tolerance = problem.gain_tolerance(known)
        self._zero = problem.zero_numerator(known, known)
        self._node = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)

    def _scan(self, block: _Block) -> tuple[Array, Array, Array]:
        """The best cut of each attribute of the block at each node (-1: none), its numerator, the number of cuts."""
        n_attributes, n = block.values.shape
        n_nodes = len(self._sizes)
        scores = self._steps[block.places]
        flat = scores.reshape(-1)
        # Over a whole node the steps add up to nothing, so one running sum serves all nodes and attributes.
        np.cumsum(flat, out=flat)
        scores -= self._sides
        tight = np.zeros((n_attributes, n), dtype=bool)
        np.less_equal(block.values[:, 1:], block.values[:, :-1] + criteria.GAP, out=tight[:, :-1])
        tight &= self._inside
        refused = np.flatnonzero(tight)
        flat[refused] = NOT_ADMISSIBLE
        run = self._node[refused % n] + (refused // n) * n_nodes
        n_cuts = np.tile(self._n_inside, n_attributes) - np.bincount(run, minlength=n_attributes * n_nodes)
        starts = (self._starts + n * np.arange(n_attributes)[:, None]).reshape(-1)
        offset = np.tile(self._terms[self._sizes], n_attributes)
        cut = best_cuts(
            flat,
            starts,
            np.tile(self._sizes, n_attributes),
            offset,
            np.tile(self._tolerance, n_attributes),
            np.tile(self._zero, n_attributes),
        )
        numerators = np.where(cut >= 0, flat[cut] + offset, 0)
        cut = np.where(cut >= 0, cut - starts, -1)
        shape = (n_attributes, n_nodes)
        return cut.reshape(shape), numerators.reshape(shape), n_cuts.reshape(shape)

    def _value_counts(self, attribute: int) -> NDArray[np.int64]:
        """How often each (node, value, class) occurs."""
        problem = self._problem
        n_values = int(problem.value_counts[attribute])
        rows = self._rows
        key = self._node * np.int64(n_values) + problem.values[rows, attribute].astype(np.int64)
        key = key * problem.n_classes + self._labels[rows]
        shape = (len(self._sizes), n_values, problem.n_classes)
        return np.bincount(key, minlength=int(np.prod(shape))).reshape(shape)

    def _descend_block(self, block: _Block) -> _Block:
        n_attributes, n = block.rows.shape
        slot = self._slot_of_row[block.rows]
        by_class = np.empty_like(slot)
        offset = n * np.arange(n_attributes, dtype=np.int32)[:, None]
        places = block.places + offset if n_attributes > 1 else block.places
        by_class.reshape(-1)[places] = slot
        rows, values, new_places = [], [], []
        passed = 0
        for s in range(1, self._slots + 1):
            here = slot == s
            rank = np.cumsum((by_class == s).reshape(-1), dtype=np.int32)
            chosen = places[here]
            own = rank[chosen].reshape(n_attributes, -1)
            count = own.shape[1]
            own += passed - 1 - count * np.arange(n_attributes, dtype=np.int32)[:, None]
            passed += count
            new_places.append(own)
            rows.append(block.rows[here].reshape(n_attributes, -1))
            values.append(block.values[here].reshape(n_attributes, -1))
        return _Block(
            block.attributes,
            np.concatenate(rows, axis=1),
            np.concatenate(values, axis=1),
            np.concatenate(new_places, axis=1),
        )
