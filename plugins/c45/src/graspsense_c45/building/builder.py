"""Growing and pruning a tree, by the interpreter or by compiled code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from graspsense_c45.arithmetic import TOLERANCE, WEIGHT_BITS, bits_below
from graspsense_c45.arrays import AnyArray, FixedPoint, Indices, Reals
from graspsense_c45.building import growing, pruning, reduced_error
from graspsense_c45.building.dealing import Deal, Entries
from graspsense_c45.building.descent import Descent, Rows
from graspsense_c45.building.nodes import Nodes
from graspsense_c45.estimates import prepare_estimation
from graspsense_c45.table import Schema, Table
from graspsense_c45.training_set import TrainingSet
from graspsense_c45.tree import ALL_VALUES, LEAF, ROOT, Splits, Tree, first_children

_ROOM = 64
"""Nodes and entries that there is room for beside those of the rows."""


class TreeBuilder:
    """Grows a tree when it is made, and prunes it on request. nodes: as they are now, arrays in `Nodes`."""

    def __init__(self, training: TrainingSet, compiled: bool) -> None:
        self._training, self._compiled = training, compiled
        self.nodes: Any = self._grown()

    def collapse(self) -> None:
        """Make leaves of subtrees that hardly save training errors."""
        training = self._training
        self._call(
            pruning.collapse,
            self.nodes,
            _zeros(len(self.nodes.feature)),
            training.weight_margin,
            training.collapse_slack,
        )

    def prune_pessimistic(self) -> None:
        """Prune by estimated errors, after collapsing if at all."""
        training, options = self._training, self._training.options
        weight_bits, n_nodes = training.scale.weight_bits, len(self.nodes.feature)
        constants = pruning.Pruning(
            prepare_estimation(options.confidence_factor, training.total_weight, weight_bits),
            training.weight_margin,
            options.subtree_raising,
        )
        errors = pruning.Errors(_zeros(n_nodes), _zeros(n_nodes), _zeros(training.n_classes))
        rows = _rows(training.values, training.small_labels(), training.weights)
        self._send_down(pruning.prune, rows, (constants, errors), None)

    def prune_reduced_error(self, table: Table, held_out: Indices) -> None:
        """Prune by the errors on these rows of a table."""
        training = self._training
        bits = bits_below(float(table.weights[held_out].sum()), WEIGHT_BITS)
        weights = np.rint(np.ldexp(table.weights[held_out], bits)).astype(np.int64)
        errors = reduced_error.HeldOutErrors(
            weight_bits=training.scale.weight_bits,
            margin=training.weight_margin,
            limit=float(np.ldexp(TOLERANCE, min(bits, 80))),
            counts=np.zeros(self.nodes.counts.shape, dtype=np.int64),
            as_tree=_zeros(len(self.nodes.feature)),
        )
        rows = _rows(table.values[held_out], table.labels[held_out], weights)
        self._send_down(reduced_error.prune_reduced_error, rows, (errors,), self.nodes.counts.sum(axis=1))

    def finished(self, schema: Schema, laplace: bool) -> Tree:
        """Return the tree without the nodes that are no longer reached, numbered breadth first."""
        order = np.concatenate(Splits(*self.nodes[:-1]).levels(ROOT))
        feature, threshold, category, _, n_children, counts = (column[order] for column in self.nodes)
        splits = Splits(
            feature.astype(np.int32),
            threshold,
            category.astype(np.int32),
            first_children(n_children),
            n_children.astype(np.int32),
        )
        weights = np.ldexp(counts.astype(np.float64), -self._training.scale.weight_bits)
        return Tree(schema, splits, weights, laplace)

    def _grown(self) -> Nodes:
        """Return the nodes of the unpruned tree."""
        training = self._training
        n_nodes = 2 * len(training.labels) + _ROOM
        n_entries = len(training.labels) + (0 if training.complete else n_nodes)
        rules = _rules(training)
        while True:
            nodes = _leaves(n_nodes, training.n_classes)
            n_grown = self._call(growing.grow, nodes, _growth(training, n_nodes, n_entries), rules)
            if n_grown > 0:
                return Nodes._make(column[:n_grown].copy() for column in map(np.asarray, nodes))
            n_nodes, n_entries = 2 * n_nodes, 2 * n_entries

    def _send_down(
        self, prune: Callable[..., bool], rows: Rows, others: tuple[Any, ...], known: FixedPoint | None
    ) -> None:
        """Prune by rows that are sent down; known: see `descent.Descent`, None where it is not given."""
        nodes, n_nodes = self.nodes, len(self.nodes.feature)
        unpruned = [np.copy(column) for column in nodes]
        n_entries = 4 * len(rows.labels) + _ROOM
        while True:
            descent = Descent(
                path=_zeros(n_nodes),
                length=_zeros(1),
                entered=_zeros(n_nodes),
                begin=_zeros(n_nodes),
                stop=_zeros(n_nodes),
                rows=np.zeros(n_entries, dtype=np.uint32),
                weights=_zeros(n_entries),
                lacking=np.zeros(1, dtype=np.bool_),
                known=_zeros(n_nodes) if known is None else known,
                given=known is not None,
            )
            if self._call(prune, nodes, rows, *others, descent):
                return
            for column, values in zip(nodes, unpruned, strict=True):
                column[:] = values
            n_entries *= 2

    def _call(self, function: Callable[..., Any], written: Any, *others: Any) -> Any:
        """Call a function of numbers and arrays, the first argument of which it writes to."""
        if self._compiled:
            from graspsense_c45.building.compiled import call

            return call(function, self._training.slim, written, *others)
        columns = _as_lists(written)
        result = function(columns, *map(_as_lists, others))
        for array, column in zip(written, columns, strict=True):
            array[:] = column
        return result


def _zeros(number: int) -> FixedPoint:
    return np.zeros(number, dtype=np.int64)


def _as_lists(value: Any) -> Any:
    """Return a value with lists in place of its arrays."""
    if isinstance(value, np.ndarray):
        return value.tolist()
    if isinstance(value, tuple) and hasattr(value, "_make"):
        return value._make(map(_as_lists, value))
    return value


def _leaves(number: int, n_classes: int) -> Nodes:
    """Return so many leaves without weight."""
    return Nodes(
        feature=np.full(number, LEAF, dtype=np.int64),
        threshold=np.full(number, np.nan),
        category=np.full(number, ALL_VALUES, dtype=np.int64),
        first_child=_zeros(number),
        n_children=_zeros(number),
        counts=np.zeros((number, n_classes), dtype=np.int64),
    )


def _rows(values: Reals, labels: AnyArray, weights: FixedPoint) -> Rows:
    return Rows(np.ascontiguousarray(values), labels, weights, not np.isnan(values).any())


def _rules(training: TrainingSet) -> growing.Rules:
    options = training.options
    return growing.Rules(
        n_rows=len(training.labels),
        n_classes=training.n_classes,
        min_objects=float(options.min_objects),
        scale=training.scale,
        weight_margin=training.weight_margin,
        mdl_correction=options.mdl_correction,
        by_ratio=options.criterion == "gain_ratio",
        binary_splits=options.binary_splits,
        unit=training.unit,
        complete=training.complete,
    )


def _growth(training: TrainingSet, n_nodes: int, n_entries: int) -> growing.Growth:
    """Return the sorted rows, and room for so many nodes and entries."""
    n_rows, n_attributes = training.values.shape
    most_values = max(2, int(training.value_counts.max(initial=0)))
    n_terms = n_rows + 1 if training.unit else 1
    return growing.Growth(
        entries=_entries(training, n_entries),
        search=growing.SplitSearch(
            candidates=growing.Candidates(
                usable=np.zeros(n_attributes, dtype=np.bool_),
                gain=np.zeros(n_attributes),
                ratio=np.zeros(n_attributes),
                place=_zeros(n_attributes),
                averaged=training.averaged,
                value_counts=training.value_counts,
            ),
            counted=growing.Counted(
                passed=_zeros(training.n_classes),
                terms=_zeros(training.n_classes),
                known=_zeros(training.n_classes),
                by_value=np.zeros((most_values, training.n_classes), dtype=np.int64),
            ),
            terms=growing.Terms(_zeros(n_terms), _zeros(n_terms - 1)),
        ),
        deal=Deal(
            slots=_zeros(n_entries),
            ordinals=_zeros(n_entries),
            known=_zeros(most_values),
            n_entries=_zeros(most_values),
            free=_zeros(most_values),
            share=np.zeros(most_values),
            parts=_zeros(most_values),
            rows=np.zeros(n_entries, dtype=np.uint32),
            values=np.zeros(n_entries),
            n_missing=_zeros(1),
        ),
        waiting=growing.Waiting(*(_zeros(n_nodes) for _ in range(4))),
    )


def _entries(training: TrainingSet, n_entries: int) -> Entries:
    n_rows, n_attributes = training.values.shape
    labels = training.small_labels()
    entries = Entries(
        rows=np.zeros((n_attributes, n_entries), dtype=np.uint32),
        values=np.zeros((n_attributes, n_entries)),
        labels=np.zeros(n_entries, dtype=labels.dtype),
        weights=_zeros(n_entries),
    )
    for a in range(n_attributes):
        column = np.ascontiguousarray(training.values[:, a])
        order = np.argsort(column)
        entries.rows[a][:n_rows] = order
        entries.values[a][:n_rows] = column[order]
    entries.labels[:n_rows] = labels
    entries.weights[:n_rows] = training.weights
    return entries
