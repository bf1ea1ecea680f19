"""The level-wise layout for rows of any weight, with missing values: entries that may be shared out among sons.

An entry is a row, or a part of one, at one node. Every numeric attribute keeps the entries that know its value,
sorted by (node, value).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE, Array
from graspsense_c45.branches import ALL_VALUES, ranges
from graspsense_c45.cuts import NOT_ADMISSIBLE, best_cuts
from graspsense_c45.grow import midpoints
from graspsense_c45.problem import Problem
from graspsense_c45.selection import NONE, Offers, offer_cuts, offer_values


class RowsOfWeight:
    """A level of open nodes; ``leaf_of_row`` holds the node each row has come to (of use where nothing is missing)."""

    def __init__(self, problem: Problem) -> None:
        self._problem = problem
        n = len(problem.labels)
        self._rows = np.arange(n)
        self._weights = problem.weights
        self._nodes = np.zeros(n, dtype=np.int64)
        self._numeric = np.flatnonzero(problem.value_counts == 0)
        self._nominal = np.flatnonzero(problem.value_counts > 0)
        self._orders: dict[int, Array] = {}
        for a in self._numeric:
            column = problem.values[:, a]
            order = np.argsort(column, kind="stable")
            self._orders[int(a)] = order[: n - np.count_nonzero(np.isnan(column))]
        self._node_weight = np.array([problem.weights.sum()])
        self._n_all_nodes = 1
        self.leaf_of_row = np.zeros(n, dtype=np.int32)

    def offers(self) -> Offers:
        """See ``grow.Level``."""
        problem = self._problem
        n_nodes = len(self._node_weight)
        offers = Offers.none(len(problem.value_counts), n_nodes)
        self._cuts: dict[int, tuple[Array, Array]] = {}
        for a in self._numeric:
            self._scan(int(a), offers)
        for a in self._nominal:
            codes = problem.values[self._rows, a]
            known = np.flatnonzero(~np.isnan(codes))
            n_values = int(problem.value_counts[a])
            key = (self._nodes[known] * n_values + codes[known].astype(np.int64)) * problem.n_classes
            key += problem.labels[self._rows[known]]
            shape = (n_nodes, n_values, problem.n_classes)
            counts = np.bincount(key, weights=self._weights[known], minlength=int(np.prod(shape)))
            offer_values(offers, int(a), counts.astype(np.int64).reshape(shape), self._node_weight, problem)
        return offers

    def thresholds(self, attribute: Array) -> NDArray[np.float64]:
        """See ``grow.Level``."""
        problem = self._problem
        self._threshold = np.full(attribute.shape, np.nan)
        for a in self._numeric:
            nodes = np.flatnonzero(attribute == a)
            if nodes.size:
                order, at = self._orders[int(a)], self._cuts[int(a)][0][nodes]
                values = problem.values[:, a]
                low, high = values[self._rows[order[at]]], values[self._rows[order[at + 1]]]
                self._threshold[nodes] = midpoints(low, high)
        return self._threshold

    def split(self, attribute: Array, value: Array, n_sons: Array) -> NDArray[np.int64]:
        """See ``grow.Level``."""
        problem = self._problem
        first_son = np.cumsum(n_sons) - n_sons
        n_all = int(n_sons.sum())
        split = attribute[self._nodes] != NONE
        at = np.flatnonzero(split)
        node = self._nodes[at]
        tested = problem.values[self._rows[at], attribute[node]]
        missing = np.isnan(tested)
        with np.errstate(invalid="ignore"):
            code = tested.astype(np.int64)
            nominal = np.where(value[node] == ALL_VALUES, code, code != value[node])
        slot = np.where(problem.value_counts[attribute[node]] > 0, nominal, tested > self._threshold[node])
        son = first_son[node] + slot
        known_weight = np.bincount(son[~missing], weights=self._weights[at][~missing], minlength=n_all)
        # The parts of a row that does not know the value: in proportion to what is known.
        gone, parts, part_weights = share(
            node[missing], self._weights[at[missing]], first_son, n_sons, known_weight
        )
        self._entry = np.concatenate((at[~missing], at[missing][gone]))
        self._son = np.concatenate((son[~missing], parts))
        self._son_weight = np.concatenate((self._weights[at[~missing]], part_weights))
        if problem.complete:
            self.leaf_of_row[self._rows[self._entry]] = self._n_all_nodes + self._son
        self._n_all_nodes += n_all
        self._n_sons, self._first_son = n_sons, first_son
        key = self._son * problem.n_classes + problem.labels[self._rows[self._entry]]
        counts = np.bincount(key, weights=self._son_weight, minlength=n_all * problem.n_classes)
        self._son_counts = counts.astype(np.int64).reshape(n_all, problem.n_classes)
        return self._son_counts

    def descend(self, open_sons: NDArray[np.bool_]) -> Array:
        """See ``grow.Level``."""
        n_old, n_slots = len(self._rows), int(self._n_sons.max(initial=0))
        rows, weights, nodes, sons = [], [], [], []
        maps = []
        slot_of_entry = self._son - self._first_son[self._nodes[self._entry]]
        count = 0
        n_nodes = 0
        for slot in range(n_slots):
            has = np.flatnonzero(self._n_sons > slot)
            here = self._first_son[has] + slot
            here = here[open_sons[here]]
            number = np.full(len(open_sons), -1)
            number[here] = n_nodes + np.arange(len(here))
            chosen = np.flatnonzero((slot_of_entry == slot) & open_sons[self._son])
            old = self._entry[chosen]
            new_id = np.full(n_old, -1)
            new_id[old] = count + np.arange(len(old))
            maps.append(new_id)
            rows.append(self._rows[old])
            weights.append(self._son_weight[chosen])
            nodes.append(number[self._son[chosen]])
            sons.append(here)
            count += len(old)
            n_nodes += len(here)
        if not n_nodes:
            return np.zeros(0, dtype=np.int64)
        for a, order in self._orders.items():
            mapped = [new_id[order] for new_id in maps]
            self._orders[a] = np.concatenate([m[m >= 0] for m in mapped])
        self._rows, self._weights = np.concatenate(rows), np.concatenate(weights)
        self._nodes = np.concatenate(nodes)
        kept = np.concatenate(sons)
        self._node_weight = self._son_counts[kept].sum(axis=1)
        return kept

    def _scan(self, attribute: int, offers: Offers) -> None:
        problem = self._problem
        order = self._orders[attribute]
        node = self._nodes[order]
        rows_known = np.bincount(node, minlength=len(self._node_weight))
        present = np.flatnonzero(rows_known)
        if not present.size:
            return
        sizes = rows_known[present]
        starts = np.cumsum(sizes) - sizes
        run = np.repeat(np.arange(len(present)), sizes)
        weights = self._weights[order]
        known = np.bincount(run, weights=weights, minlength=len(present)).astype(np.int64)
        steps = self._steps(run, len(present), order, weights)
        scores = np.cumsum(steps)
        running = np.cumsum(weights)
        left = running - np.repeat(running[starts] - weights[starts], sizes)
        right = np.repeat(known, sizes) - left
        scores -= problem.terms(left) + problem.terms(right)
        real_known = problem.real_weights(known)
        least_weight = criteria.min_side_weight(real_known, problem.n_classes, problem.options.min_objects)
        least = np.repeat(problem.units_at_least(least_weight), sizes)
        values = problem.values[self._rows[order], attribute]
        admissible = (left >= least) & (right >= least)
        admissible[:-1] &= values[:-1] + criteria.GAP < values[1:]
        admissible[starts + sizes - 1] = False
        scores[~admissible] = NOT_ADMISSIBLE
        offset = problem.terms(known)
        weight = self._node_weight[present]
        real_weight = problem.real_weights(weight)
        with np.errstate(divide="ignore"):
            zero = problem.zero_numerator(real_weight, np.maximum(real_known, TOLERANCE))
        cut = best_cuts(scores, starts, sizes, offset, problem.gain_tolerance(real_weight), zero)
        cut[~criteria.has_enough_rows(sizes, least_weight)] = -1
        found = np.flatnonzero(cut >= 0)
        at = cut[found]
        n_cuts = np.bincount(run[admissible], minlength=len(present))
        offer_cuts(
            offers,
            np.full(len(found), attribute),
            present[found],
            scores[at] + offset[found],
            n_cuts[found],
            left[at],
            known[found],
            weight[found],
            problem,
        )
        every = np.full(len(self._node_weight), -1)
        every[present] = cut
        self._cuts[attribute] = (every, left)

    def _steps(self, run: Array, n_runs: int, order: Array, weights: Array) -> NDArray[np.int64]:
        """What each entry, passed from right to left, does to the sum of ``x ln x`` over classes and sides."""
        problem = self._problem
        key = run * problem.n_classes + problem.labels[self._rows[order]]
        n_keys = n_runs * problem.n_classes
        by_class = np.argsort(key, kind="stable")
        in_class = np.bincount(key, minlength=n_keys)
        total = np.bincount(key, weights=weights, minlength=n_keys).astype(np.int64)
        weights_by_class = weights[by_class]
        passed = np.cumsum(weights_by_class) - np.repeat(np.cumsum(total) - total, in_class)
        totals = np.repeat(total, in_class)
        terms = problem.terms(passed) + problem.terms(totals - passed)
        before = np.empty_like(terms)
        before[1:] = terms[:-1]
        first = (np.cumsum(in_class) - in_class)[in_class > 0]
        before[first] = problem.terms(total[in_class > 0])
        steps = np.empty_like(terms)
        steps[by_class] = terms - before
        return steps


def share(
    node: Array, weights: Array, first_son: Array, n_sons: Array, known_weight: Array
) -> tuple[Array, Array, Array]:
    """Share rows at ``node`` out among its sons in proportion to their known weight (evenly where none is known).

    ``first_son`` and ``n_sons`` are indexed by node, ``known_weight`` by son. Returns for every part the index of its
    row, its son and its fixed-point weight; sons of a proportion within the tolerance of 0 get no part.
    """
    each = n_sons[node]
    row = np.repeat(np.arange(len(node)), each)
    son = ranges(first_son[node], each)
    total = np.bincount(row, weights=known_weight[son], minlength=len(node))
    evenly = 1.0 / np.maximum(each, 1)[row]
    proportion = np.where(total[row] > 0, known_weight[son] / np.where(total > 0, total, 1.0)[row], evenly)
    kept = proportion > TOLERANCE
    return row[kept], son[kept], np.rint(weights[row[kept]] * proportion[kept]).astype(np.int64)
