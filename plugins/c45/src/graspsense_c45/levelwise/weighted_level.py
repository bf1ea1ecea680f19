"""A level of rows of any weight, with missing values: a row may be distributed over the children of a node.

An entry is a row, or a part of one, at one node. Every numeric attribute keeps the entries that know its value,
sorted by (node, value).
"""

from __future__ import annotations

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import FixedPoint, Indices, Mask, Reals
from graspsense_c45.levelwise.best_cuts import NOT_ADMISSIBLE, best_cuts
from graspsense_c45.levelwise.candidates import NO_SPLIT, CandidateSplits, Cuts
from graspsense_c45.levelwise.growing import midpoints
from graspsense_c45.routing import distribute
from graspsense_c45.splits import ALL_VALUES
from graspsense_c45.training_set import TrainingSet


class WeightedLevel:
    """The open nodes of a depth; see `growing.NodeLevel`.

    leaf_of_row: the node that each row has come to, where no value is missing.
    """

    def __init__(self, training: TrainingSet) -> None:
        self._training = training
        n = len(training.labels)
        self._rows = np.arange(n)
        self._weights = training.weights
        self._nodes = np.zeros(n, dtype=np.int64)
        self._numeric = np.flatnonzero(training.value_counts == 0)
        self._nominal = np.flatnonzero(training.value_counts > 0)
        self._orders: dict[int, Indices] = {}
        for a in self._numeric:
            column = training.values[:, a]
            order = np.argsort(column, kind="stable")
            self._orders[int(a)] = order[: n - np.count_nonzero(np.isnan(column))]
        self._node_weight = np.array([training.weights.sum()])
        self._n_all_nodes = 1
        self.leaf_of_row = np.zeros(n, dtype=np.int32)

    def candidates(self) -> CandidateSplits:
        """See `growing.NodeLevel`."""
        training = self._training
        n_nodes = len(self._node_weight)
        candidates = CandidateSplits.none(len(training.value_counts), n_nodes)
        self._cuts: dict[int, tuple[Indices, FixedPoint]] = {}
        for a in self._numeric:
            self._scan(int(a), candidates)
        for a in self._nominal:
            codes = training.values[self._rows, a]
            known = np.flatnonzero(~np.isnan(codes))
            n_values = int(training.value_counts[a])
            key = (self._nodes[known] * n_values + codes[known].astype(np.int64)) * training.n_classes
            key += training.labels[self._rows[known]]
            shape = (n_nodes, n_values, training.n_classes)
            counts = np.bincount(key, weights=self._weights[known], minlength=int(np.prod(shape)))
            candidates.enter_values(
                int(a), counts.astype(np.int64).reshape(shape), self._node_weight, training
            )
        return candidates

    def thresholds(self, feature: Indices) -> Reals:
        """See `growing.NodeLevel`."""
        training = self._training
        self._threshold = np.full(feature.shape, np.nan)
        for a in self._numeric:
            nodes = np.flatnonzero(feature == a)
            if nodes.size:
                order, at = self._orders[int(a)], self._cuts[int(a)][0][nodes]
                values = training.values[:, a]
                low, high = values[self._rows[order[at]]], values[self._rows[order[at + 1]]]
                self._threshold[nodes] = midpoints(low, high)
        return self._threshold

    def split(self, feature: Indices, category: Indices, n_children: Indices) -> FixedPoint:
        """See `growing.NodeLevel`."""
        training = self._training
        first_child = np.cumsum(n_children) - n_children
        n_all = int(n_children.sum())
        at = np.flatnonzero(feature[self._nodes] != NO_SPLIT)
        node, weights = self._nodes[at], self._weights[at]
        slot, missing = self._slots(at, feature[node], category[node])
        child = first_child[node] + slot
        known_weight = np.bincount(child[~missing], weights=weights[~missing], minlength=n_all)
        # An entry that does not know the value is distributed in proportion to what is known.
        part_of, parts, part_weights = distribute(
            node[missing], weights[missing], first_child, n_children, known_weight
        )
        self._entry = np.concatenate((at[~missing], at[missing][part_of]))
        self._child = np.concatenate((child[~missing], parts))
        self._child_weight = np.concatenate((weights[~missing], part_weights))
        if training.complete:
            self.leaf_of_row[self._rows[self._entry]] = self._n_all_nodes + self._child
        self._n_all_nodes += n_all
        self._n_children, self._first_child = n_children, first_child
        key = self._child * training.n_classes + training.labels[self._rows[self._entry]]
        counts = np.bincount(key, weights=self._child_weight, minlength=n_all * training.n_classes)
        self._child_counts = counts.astype(np.int64).reshape(n_all, training.n_classes)
        return self._child_counts

    def descend(self, open_children: Mask) -> Indices:
        """See `growing.NodeLevel`."""
        n_old, n_slots = len(self._rows), int(self._n_children.max(initial=0))
        rows, weights, nodes, children = [], [], [], []
        maps = []
        slot_of_entry = self._child - self._first_child[self._nodes[self._entry]]
        count = 0
        n_nodes = 0
        for slot in range(n_slots):
            has = np.flatnonzero(self._n_children > slot)
            here = self._first_child[has] + slot
            here = here[open_children[here]]
            number = np.full(len(open_children), -1)
            number[here] = n_nodes + np.arange(len(here))
            chosen = np.flatnonzero((slot_of_entry == slot) & open_children[self._child])
            old = self._entry[chosen]
            new_id = np.full(n_old, -1)
            new_id[old] = count + np.arange(len(old))
            maps.append(new_id)
            rows.append(self._rows[old])
            weights.append(self._child_weight[chosen])
            nodes.append(number[self._child[chosen]])
            children.append(here)
            count += len(old)
            n_nodes += len(here)
        if not n_nodes:
            return np.zeros(0, dtype=np.int64)
        for a, order in self._orders.items():
            mapped = [new_id[order] for new_id in maps]
            self._orders[a] = np.concatenate([m[m >= 0] for m in mapped])
        self._rows, self._weights = np.concatenate(rows), np.concatenate(weights)
        self._nodes = np.concatenate(nodes)
        kept = np.concatenate(children)
        self._node_weight = self._child_counts[kept].sum(axis=1)
        return kept

    def _slots(self, entries: Indices, feature: Indices, category: Indices) -> tuple[Indices, Mask]:
        """Return the slot of the child of each entry, and where the tested value is missing."""
        tested = self._training.values[self._rows[entries], feature]
        with np.errstate(invalid="ignore"):
            code = tested.astype(np.int64)
        nominal = np.where(category == ALL_VALUES, code, code != category)
        above = tested > self._threshold[self._nodes[entries]]
        return np.where(self._training.value_counts[feature] > 0, nominal, above), np.isnan(tested)

    def _scan(self, attribute: int, candidates: CandidateSplits) -> None:
        """Enter the best cuts of a numeric attribute."""
        training = self._training
        order = self._orders[attribute]
        rows_known = np.bincount(self._nodes[order], minlength=len(self._node_weight))
        present = np.flatnonzero(rows_known)
        if not present.size:
            return
        sizes = rows_known[present]
        starts = np.cumsum(sizes) - sizes
        run = np.repeat(np.arange(len(present)), sizes)
        weights = self._weights[order]
        known = np.bincount(run, weights=weights, minlength=len(present)).astype(np.int64)
        scores = np.cumsum(self._steps(run, len(present), order, weights))
        running = np.cumsum(weights)
        left = running - np.repeat(running[starts] - weights[starts], sizes)
        right = np.repeat(known, sizes) - left
        scores -= training.terms(left) + training.terms(right)
        least_weight = criteria.min_side_weight(
            training.real_weights(known), training.n_classes, training.options.min_objects
        )
        least = np.repeat(training.least_units(least_weight), sizes)
        values = training.values[self._rows[order], attribute]
        admissible = (left >= least) & (right >= least)
        admissible[:-1] &= criteria.are_apart(values[:-1], values[1:])
        admissible[starts + sizes - 1] = False
        scores[~admissible] = NOT_ADMISSIBLE
        offset, weight = training.terms(known), self._node_weight[present]
        cut = best_cuts(scores, starts, sizes, offset, *self._tolerances(weight, known))
        cut[~criteria.has_enough_rows(sizes, least_weight)] = -1
        where = np.flatnonzero(cut >= 0)
        at = cut[where]
        n_cuts = np.bincount(run[admissible], minlength=len(present))[where]
        numerator = scores[at] + offset[where]
        here = np.full(len(where), attribute)
        cuts = Cuts(here, present[where], numerator, n_cuts, left[at], known[where], weight[where])
        candidates.enter_cuts(cuts, training)
        every = np.full(len(self._node_weight), -1)
        every[present] = cut
        self._cuts[attribute] = (every, left)

    def _tolerances(self, weight: FixedPoint, known: FixedPoint) -> tuple[FixedPoint, FixedPoint]:
        """Return the tolerance and the least numerator of a gain, at nodes of these weights."""
        training = self._training
        real_weight = training.real_weights(weight)
        with np.errstate(divide="ignore"):
            least = training.least_numerator(real_weight, np.maximum(training.real_weights(known), TOLERANCE))
        return training.gain_tolerance(real_weight), least

    def _steps(self, run: Indices, n_runs: int, order: Indices, weights: FixedPoint) -> FixedPoint:
        """Return what moving each entry from right to left changes in the sum of ``x ln x`` over classes and sides."""
        training = self._training
        key = run * training.n_classes + training.labels[self._rows[order]]
        n_keys = n_runs * training.n_classes
        by_class = np.argsort(key, kind="stable")
        in_class = np.bincount(key, minlength=n_keys)
        total = np.bincount(key, weights=weights, minlength=n_keys).astype(np.int64)
        weights_by_class = weights[by_class]
        passed = np.cumsum(weights_by_class) - np.repeat(np.cumsum(total) - total, in_class)
        totals = np.repeat(total, in_class)
        terms = training.terms(passed) + training.terms(totals - passed)
        before = np.empty_like(terms)
        before[1:] = terms[:-1]
        first = (np.cumsum(in_class) - in_class)[in_class > 0]
        before[first] = training.terms(total[in_class > 0])
        steps = np.empty_like(terms)
        steps[by_class] = terms - before
        return steps
