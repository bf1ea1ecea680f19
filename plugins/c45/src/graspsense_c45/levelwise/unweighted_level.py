"""A level of rows that all weigh 1 and miss no value. Splits are found by counting, mostly once per level.

Every attribute keeps its row indices sorted by (node, value), and for each of them its place in a second layout that is
sorted by (node, class, value). In that second layout the running class counts of a node are the same for all
attributes. What moving a row from the right to the left side changes in ``sum x ln x`` is therefore computed once
per level, and each attribute needs only a gather and a running sum. Descending keeps both orders by selection, so
nothing is sorted again.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from attrs import frozen

from graspsense_c45 import criteria
from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, Mask, NodeColumn, Reals
from graspsense_c45.levelwise.best_cuts import NOT_ADMISSIBLE, best_cuts
from graspsense_c45.levelwise.candidates import CandidateSplits, Cuts
from graspsense_c45.levelwise.growing import midpoints
from graspsense_c45.splits import ALL_VALUES, ranges
from graspsense_c45.training_set import TrainingSet

JOINT_SIZE = 60_000
"""Entries (attributes x rows) up to which all attributes are processed together: they fit the processor's caches."""


@frozen(eq=False)
class _Block:
    """Some numeric attributes, one per row of each array.

    rows, values: sorted by (node, value). places: of each row in the layout sorted by (node, class, value).
    """

    attributes: Indices
    rows: NodeColumn
    values: Reals
    places: NodeColumn


class UnweightedLevel:
    """The open nodes of a depth; see `growing.NodeLevel`. leaf_of_row: the node that each row has come to."""

    def __init__(self, training: TrainingSet) -> None:
        self._training = training
        n = len(training.labels)
        self._labels = training.small_labels()
        self._numeric = np.flatnonzero(training.value_counts == 0)
        self._nominal = np.flatnonzero(training.value_counts > 0)
        self._terms = training.terms(np.arange(n + 1))
        self._step = np.diff(self._terms)
        self._blocks = [self._sorted_block(a) for a in self._numeric.tolist()]
        self._rows = np.arange(n, dtype=np.int32)
        self._counts = np.bincount(training.labels, minlength=training.n_classes)[None, :]
        self._n_nodes = 1
        self.leaf_of_row = np.zeros(n, dtype=np.int32)
        self._measure()

    def candidates(self) -> CandidateSplits:
        """See `growing.NodeLevel`."""
        training = self._training
        n_attributes, n_nodes = len(training.value_counts), len(self._sizes)
        candidates = CandidateSplits.none(n_attributes, n_nodes)
        self._prepare_scan()
        self._cut = np.full((n_attributes, n_nodes), -1, dtype=np.int64)
        numerators = np.zeros(self._cut.shape, dtype=np.int64)
        n_cuts = np.zeros(self._cut.shape, dtype=np.int64)
        for block in self._blocks:
            cut, numerators[block.attributes], n_cuts[block.attributes] = self._scan(block)
            self._cut[block.attributes] = cut
        attribute, node = place = np.nonzero(self._cut >= 0)
        sizes, left = self._sizes[node], self._cut[place] + 1
        cuts = Cuts(attribute, node, numerators[place], n_cuts[place], left, sizes, sizes)
        candidates.enter_cuts(cuts, training)
        for a in self._nominal.tolist():
            candidates.enter_values(a, self._value_counts(a), self._sizes, training)
        # These are as large as the rows and no longer needed.
        del self._steps, self._sides, self._inside, self._node
        return candidates

    def thresholds(self, feature: Indices) -> Reals:
        """See `growing.NodeLevel`."""
        low, high = np.zeros(feature.shape), np.full(feature.shape, np.nan)
        for block in self._blocks:
            nodes, at = self._begins(block, feature)
            at = at + self._cut[feature[nodes], nodes]
            values = block.values.reshape(-1)
            low[nodes], high[nodes] = values[at], values[at + 1]
        return midpoints(low, high)

    def split(self, feature: Indices, category: Indices, n_children: Indices) -> FixedPoint:
        """See `growing.NodeLevel`."""
        training = self._training
        first_child = np.cumsum(n_children) - n_children
        n_all = int(n_children.sum())
        self._slots = int(n_children.max(initial=0))
        self._slot_of_row = np.zeros(len(training.labels), dtype=np.min_scalar_type(self._slots))
        self._child_first, self._n_children = first_child, n_children
        counts = np.zeros(n_all * training.n_classes, dtype=np.int64)
        for nodes, rows, slots in self._slots_of_rows(feature, category):
            children = np.repeat(first_child[nodes], self._sizes[nodes]) + slots
            self._slot_of_row[rows] = slots + 1
            self.leaf_of_row[rows] = self._n_nodes + children
            counts += np.bincount(children * training.n_classes + self._labels[rows], minlength=len(counts))
        self._n_nodes += n_all
        self._child_counts = counts.reshape(n_all, training.n_classes)
        return self._child_counts

    def descend(self, open_children: Mask) -> Indices:
        """See `growing.NodeLevel`."""
        if not open_children.any():
            return np.zeros(0, dtype=np.int64)
        # Slot 0 marks rows that have come to a leaf, slot s + 1 rows that go to child s.
        closed = np.flatnonzero(~open_children)
        if closed.size:
            first = self._n_nodes - len(open_children)
            reached = self.leaf_of_row - first
            done = reached >= 0
            done[done] = ~open_children[reached[done]]
            self._slot_of_row[done] = 0
        kept = []
        for slot in range(self._slots):
            has = np.flatnonzero(self._n_children > slot)
            children = self._child_first[has] + slot
            kept.append(children[open_children[children]])
        children = np.concatenate(kept)
        for i, block in enumerate(self._blocks):
            self._blocks[i] = self._descend_block(block)
        slots = self._slot_of_row[self._rows]
        self._rows = np.concatenate([self._rows[slots == s + 1] for s in range(self._slots)])
        self._counts = self._child_counts[children]
        del self._slot_of_row
        self._measure()
        self._join_blocks()
        return children

    def _sorted_block(self, attribute: int) -> _Block:
        column = np.ascontiguousarray(self._training.values[:, attribute])
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

    def _begins(self, block: _Block, feature: Indices) -> tuple[Indices, Indices]:
        """Return the nodes that split on an attribute of the block, and where their rows begin in its flat arrays."""
        number = np.full(len(self._training.value_counts) + 1, -1)
        number[block.attributes] = np.arange(len(block.attributes))
        place = number[feature]
        nodes = np.flatnonzero(place >= 0)
        return nodes, place[nodes] * block.rows.shape[1] + self._starts[nodes]

    def _slots_of_rows(
        self, feature: Indices, category: Indices
    ) -> Iterator[tuple[Indices, NodeColumn, AnyArray]]:
        """Yield, piece by piece, nodes that split, their rows (node by node), and the slot of the child of each row."""
        for block in self._blocks:
            nodes, begins = self._begins(block, feature)
            if nodes.size:
                sizes = self._sizes[nodes]
                rows = block.rows.reshape(-1)[ranges(begins, sizes)]
                slots = np.ones(len(rows), dtype=np.int64)
                slots[ranges(np.cumsum(sizes) - sizes, self._cut[feature[nodes], nodes] + 1)] = 0
                yield nodes, rows, slots
        for a in self._nominal.tolist():
            nodes = np.flatnonzero(feature == a)
            if nodes.size:
                rows = self._rows[ranges(self._starts[nodes], self._sizes[nodes])]
                code = self._training.values[rows, a].astype(np.int64)
                tested = np.repeat(category[nodes], self._sizes[nodes])
                yield nodes, rows, np.where(tested == ALL_VALUES, code, code != tested)

    def _prepare_scan(self) -> None:
        """Compute what all attributes share: the step of every place, the terms of both sides at every position."""
        training, sizes, starts = self._training, self._sizes, self._starts
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
        known = training.real_weights(sizes)
        least_weight = criteria.min_side_weight(known, training.n_classes, training.options.min_objects)
        least = training.least_units(least_weight)
        each = np.repeat(least, sizes)
        self._inside = (left >= each) & (right >= each)
        self._sides[~self._inside] = -NOT_ADMISSIBLE
        self._n_inside = np.maximum(sizes - 2 * least + 1, 0)
        self._tolerance = training.gain_tolerance(known)
        self._least = training.least_numerator(known, known)
        self._node = np.repeat(np.arange(len(sizes), dtype=np.int32), sizes)

    def _scan(self, block: _Block) -> tuple[Indices, FixedPoint, Indices]:
        """Return the best cut of each attribute of the block at each node (-1: none), its numerator, the number of
        cuts.

        A cut is a position among the rows of the node.
        """
        n_attributes, n = block.values.shape
        n_nodes = len(self._sizes)
        scores = self._steps[block.places]
        flat = scores.reshape(-1)
        # Over a whole node the steps add up to 0, so one running sum serves all nodes and attributes.
        np.cumsum(flat, out=flat)
        scores -= self._sides
        tight = np.zeros((n_attributes, n), dtype=bool)
        np.logical_not(criteria.are_apart(block.values[:, :-1], block.values[:, 1:]), out=tight[:, :-1])
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
            np.tile(self._least, n_attributes),
        )
        numerators = np.where(cut >= 0, flat[cut] + offset, 0)
        cut = np.where(cut >= 0, cut - starts, -1)
        shape = (n_attributes, n_nodes)
        return cut.reshape(shape), numerators.reshape(shape), n_cuts.reshape(shape)

    def _value_counts(self, attribute: int) -> FixedPoint:
        """Return how often each (node, value, class) occurs."""
        training = self._training
        n_values = int(training.value_counts[attribute])
        rows = self._rows
        key = self._node * np.int64(n_values) + training.values[rows, attribute].astype(np.int64)
        key = key * training.n_classes + self._labels[rows]
        shape = (len(self._sizes), n_values, training.n_classes)
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
