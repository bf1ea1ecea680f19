"""Growing a tree, one node after the other, depth first."""

from __future__ import annotations

import numpy as np

from graspsense_c45 import criteria
from graspsense_c45.arithmetic import TOLERANCE
from graspsense_c45.arrays import FixedPoint, Indices, Mask, Reals
from graspsense_c45.nodewise.cuts import BestCuts, CutLimits, SortedRows, best_cuts
from graspsense_c45.nodewise.nodes import NodeList, NodeRows
from graspsense_c45.nodewise.nominal import split_by_values
from graspsense_c45.routing import distribute
from graspsense_c45.splits import ALL_VALUES, GrowingTree
from graspsense_c45.training_set import TrainingSet


def grow(training: TrainingSet) -> GrowingTree:
    """Return the unpruned tree, whose thresholds are midpoints."""
    return _Grower(training).grow()


class _Grower:
    """The state of growing: the nodes so far, and arrays over the attributes that each node uses again."""

    def __init__(self, training: TrainingSet) -> None:
        self._training = training
        self._numeric = np.flatnonzero(training.value_counts == 0)
        self._nominal = np.flatnonzero(training.value_counts > 0).tolist()
        # A row for each attribute, so that the values of one lie together.
        self._columns = np.ascontiguousarray(training.values.T)
        self._labels = training.small_labels()
        self._scratch: Mask = np.zeros(len(training.labels), dtype=np.bool_)
        self._weight_of: FixedPoint = np.zeros(len(training.labels), dtype=np.int64)
        n_attributes = len(training.value_counts)
        self._usable = np.zeros(n_attributes, dtype=np.bool_)
        self._gain, self._ratio = np.zeros(n_attributes), np.zeros(n_attributes)
        self._split = [(np.nan, ALL_VALUES)] * n_attributes

    def grow(self) -> GrowingTree:
        """Return the tree."""
        training = self._training
        counts = np.bincount(training.labels, weights=training.weights, minlength=training.n_classes)
        nodes = NodeList([counts.astype(np.int64)])
        order = np.argsort(self._columns[self._numeric], axis=1, kind="stable")
        root = NodeRows(np.arange(len(training.labels)), training.weights, order)
        stack = [(0, root)] if self._is_open(nodes.counts[0]) else []
        while stack:
            node, rows = stack.pop()
            feature = self._best_attribute(nodes.counts[node], rows)
            if feature < 0:
                continue
            threshold, category = self._split[feature]
            children = self._children(rows, feature, threshold, category)
            child_counts = np.array(
                [
                    np.bincount(
                        self._labels[rows.rows[entries]], weights=weights, minlength=training.n_classes
                    )
                    for entries, weights in children
                ]
            ).astype(np.int64)
            eldest = nodes.split(node, (feature, threshold, category), child_counts)
            for child in range(len(children) - 1, -1, -1):
                if self._is_open(child_counts[child]):
                    entries, weights = children[child]
                    stack.append((eldest + child, rows.child(entries, weights, self._scratch)))
        return nodes.tree()

    def _is_open(self, counts: FixedPoint) -> bool:
        """Return whether a node with these counts may be split."""
        training = self._training
        weight = float(training.real_weights(counts.sum()))
        majority = float(training.real_weights(counts[training.majority_of(counts)]))
        return not criteria.is_pure_or_small(weight, majority, training.options.min_objects)

    def _best_attribute(self, counts: FixedPoint, rows: NodeRows) -> int:
        """Return the attribute to split an open node on, -1 where it stays a leaf; write the splits of all."""
        self._usable[:] = False
        weight = int(counts.sum())
        if self._numeric.size:
            self._enter_cuts(counts, weight, rows)
        for a in self._nominal:
            self._enter_values(a, weight, rows)
        training = self._training
        return criteria.choose_attribute(
            self._usable.tolist(),
            self._gain.tolist(),
            self._ratio.tolist(),
            training.averaged.tolist(),
            training.options.criterion == "gain_ratio",
        )

    def _enter_cuts(self, counts: FixedPoint, weight: int, rows: NodeRows) -> None:
        """Enter the best cuts of the numeric attributes."""
        training, numeric = self._training, self._numeric
        values = self._columns[numeric[:, None], rows.order]
        self._weight_of[rows.rows] = rows.weights
        weights = self._weight_of[rows.order]
        labels = self._labels[rows.order]
        if training.complete:
            totals = np.broadcast_to(counts, (len(numeric), len(counts)))
            n_known = np.full(len(numeric), len(rows.rows))
        else:
            missing = np.isnan(values)
            weights[missing] = 0
            n_known = len(rows.rows) - missing.sum(axis=1)
            totals = self._totals(labels, weights)
        known = totals.sum(axis=1)
        real_weight, real_known = float(training.real_weights(weight)), training.real_weights(known)
        least_weight = criteria.min_side_weight(real_known, training.n_classes, training.options.min_objects)
        with np.errstate(divide="ignore"):
            least = training.least_numerator(real_weight, np.maximum(real_known, TOLERANCE))
        limits = CutLimits(
            totals, training.least_units(least_weight), least, int(training.gain_tolerance(real_weight))
        )
        cuts = best_cuts(SortedRows(values, labels, weights), limits, training)
        chosen = np.flatnonzero((cuts.place >= 0) & criteria.has_enough_rows(n_known, least_weight))
        if chosen.size:
            self._enter(chosen, BestCuts(*(column[chosen] for column in cuts)), known[chosen], weight)
        place = cuts.place[chosen]
        low, high = values[chosen, place], values[chosen, place + 1]
        with np.errstate(over="ignore"):
            middles = np.asarray(criteria.midpoint(low, high)).tolist()
        for a, middle in zip(numeric[chosen].tolist(), middles, strict=True):
            self._split[a] = (middle, ALL_VALUES)

    def _enter(self, chosen: Indices, cuts: BestCuts, known: FixedPoint, weight: int) -> None:
        """Enter gain and gain ratio of cuts, and whether they may be chosen."""
        training, attributes = self._training, self._numeric[chosen]
        gain = criteria.gain_of_cut(
            cuts.numerator, cuts.n_cuts, known, weight, training.scale, training.options.mdl_correction
        )
        whole = np.array([weight])
        terms = training.terms(np.concatenate((whole, cuts.left, known - cuts.left, weight - known)))
        split = terms[0] - terms[1:].reshape(3, -1).sum(axis=0)
        self._usable[attributes] = gain >= TOLERANCE
        self._gain[attributes] = gain
        self._ratio[attributes] = criteria.ratio_of_cut(gain, split, weight, training.scale)

    def _totals(self, labels: Indices, weights: FixedPoint) -> FixedPoint:
        """Return the weight of each class for each attribute (attributes x classes)."""
        n_classes = self._training.n_classes
        key = labels + n_classes * np.arange(len(labels), dtype=np.int64)[:, None]
        counted = np.bincount(key.ravel(), weights=weights.ravel(), minlength=len(labels) * n_classes)
        return counted.astype(np.int64).reshape(len(labels), n_classes)

    def _enter_values(self, attribute: int, weight: int, rows: NodeRows) -> None:
        """Enter the best split of a nominal attribute."""
        training = self._training
        codes = self._columns[attribute, rows.rows]
        known = np.flatnonzero(~np.isnan(codes))
        n_values = int(training.value_counts[attribute])
        key = codes[known].astype(np.int64) * training.n_classes + training.labels[rows.rows[known]]
        counted = np.bincount(key, weights=rows.weights[known], minlength=n_values * training.n_classes)
        counts = counted.astype(np.int64).reshape(n_values, training.n_classes)
        split = split_by_values(counts, weight, training)
        self._usable[attribute], self._gain[attribute], self._ratio[attribute] = split[:3]
        self._split[attribute] = (np.nan, split.category)

    def _children(
        self, rows: NodeRows, feature: int, threshold: float, category: int
    ) -> list[tuple[Indices, FixedPoint]]:
        """Return the rows of each child, as places in `rows`, with their weights there."""
        tested: Reals = self._columns[feature, rows.rows]
        declared = int(self._training.value_counts[feature])
        number = declared if declared and category == ALL_VALUES else 2
        missing = np.isnan(tested)
        with np.errstate(invalid="ignore"):
            if not declared:
                slots = (tested > threshold).astype(np.int64)
            elif category == ALL_VALUES:
                slots = tested.astype(np.int64)
            else:
                slots = (tested.astype(np.int64) != category).astype(np.int64)
        if not missing.any():
            places = [np.flatnonzero(slots == slot) for slot in range(number)]
            return [(place, rows.weights[place]) for place in places]
        known, unknown = np.flatnonzero(~missing), np.flatnonzero(missing)
        known_weight = np.bincount(slots[known], weights=rows.weights[known], minlength=number)
        part_of, slot_of_part, part_weights = distribute(
            np.zeros(len(unknown), dtype=np.int64),
            rows.weights[unknown],
            np.zeros(1, dtype=np.int64),
            np.array([number]),
            known_weight,
        )
        entries = np.concatenate((known, unknown[part_of]))
        slots = np.concatenate((slots[known], slot_of_part))
        weights = np.concatenate((rows.weights[known], part_weights))
        return [(entries[slots == slot], weights[slots == slot]) for slot in range(number)]
