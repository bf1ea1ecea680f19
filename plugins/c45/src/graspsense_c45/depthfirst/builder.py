"""The compiled engine as a builder of trees."""

from __future__ import annotations

import numpy as np

from graspsense_c45.depthfirst import compiled, growing, pruning
from graspsense_c45.depthfirst.growing import Candidates, Columns, Rules
from graspsense_c45.depthfirst.nodes import Nodes, Rows, empty_nodes
from graspsense_c45.depthfirst.pruning import Errors, Pruning
from graspsense_c45.estimates import prepare_estimation
from graspsense_c45.splits import ALL_VALUES, LEAF, GrowingTree
from graspsense_c45.training_set import TrainingSet


class DepthFirstTreeBuilder:
    """Grows a tree when it is made; see `fitting.TreeBuilder`. It builds the trees that `can_build` accepts."""

    def __init__(self, training: TrainingSet) -> None:
        self._training = training
        columns = _columns(training)
        self._nodes = _grown(columns, training)
        self._order = columns.rows[0].copy()
        self.tree = _as_tree(self._nodes)

    @staticmethod
    def can_build(training: TrainingSet) -> bool:
        """Return whether all attributes are numeric and no value is missing."""
        return training.complete and not training.value_counts.any()

    def collapse(self) -> None:
        """Make leaves of subtrees that hardly save training errors."""
        errors = np.zeros(len(self._nodes.feature), dtype=np.int64)
        compiled.collapse(self._nodes, errors, self._training.weight_margin, self._training.collapse_slack)
        self._mark_leaves()

    def prune_pessimistic(self) -> None:
        """Prune by estimated errors."""
        training, options = self._training, self._training.options
        weight_bits = training.scale.weight_bits
        estimation = prepare_estimation(options.confidence_factor, training.total_weight, weight_bits)
        rows = Rows(
            self._order, np.ascontiguousarray(training.values), training.small_labels(), training.weights
        )
        constants = Pruning(estimation, training.weight_margin, options.subtree_raising)
        n_nodes, n_rows = len(self._nodes.feature), len(self._order)
        errors = Errors(
            np.zeros(n_nodes, dtype=np.int64),
            np.zeros(n_nodes, dtype=np.int64),
            np.zeros((n_nodes, training.n_classes + 1), dtype=np.int64),
        )
        workspace = pruning.PruningSpace(
            listed=np.empty(n_nodes, dtype=np.int64),
            waiting=np.empty(n_nodes, dtype=np.int64),
            joined=np.empty(n_nodes, dtype=np.int64),
            rows=np.empty(n_rows, dtype=np.uint32),
            leaves=np.empty(n_rows, dtype=np.int64),
        )
        compiled.prune(self._nodes, rows, constants, errors, workspace)
        self._mark_leaves()

    def _mark_leaves(self) -> None:
        self.tree.n_children[self.tree.feature == LEAF] = 0


def _grown(columns: Columns, training: TrainingSet) -> Nodes:
    """Return the nodes of the unpruned tree; sorts `columns` by leaf."""
    n_attributes, n_rows = columns.rows.shape
    nodes = empty_nodes(2 * n_rows, training.n_classes)
    candidates = Candidates(
        usable=np.zeros(n_attributes, dtype=np.bool_),
        gain=np.zeros(n_attributes),
        ratio=np.zeros(n_attributes),
        place=np.zeros(n_attributes, dtype=np.int64),
        averaged=training.averaged,
    )
    workspace = growing.GrowingSpace(
        goes_left=np.zeros(n_rows, dtype=np.bool_),
        rows=np.empty(n_rows, dtype=np.uint32),
        values=np.empty(n_rows),
        passed=np.zeros(training.n_classes, dtype=np.int64),
        waiting=np.empty(2 * n_rows, dtype=np.int64),
    )
    n_nodes = compiled.grow(nodes, columns, _rules(training), candidates, workspace)
    return Nodes._make(column[:n_nodes].copy() for column in nodes)


def _columns(training: TrainingSet) -> Columns:
    n_rows, n_attributes = training.values.shape
    rows = np.empty((n_attributes, n_rows), dtype=np.uint32)
    values = np.empty((n_attributes, n_rows))
    for a in range(n_attributes):
        column = np.ascontiguousarray(training.values[:, a])
        rows[a] = np.argsort(column)
        values[a] = column[rows[a]]
    terms = training.terms(np.arange(n_rows + 1)) if training.unit else np.zeros(1, dtype=np.int64)
    return Columns(
        rows=rows,
        values=values,
        labels=training.small_labels(),
        weights=training.weights,
        terms=terms,
        steps=np.diff(terms),
    )


def _rules(training: TrainingSet) -> Rules:
    options = training.options
    return Rules(
        n_classes=training.n_classes,
        min_objects=float(options.min_objects),
        scale=training.scale,
        weight_margin=training.weight_margin,
        mdl_correction=options.mdl_correction,
        by_ratio=options.criterion == "gain_ratio",
        unit=training.unit,
    )


def _as_tree(nodes: Nodes) -> GrowingTree:
    """Return the nodes as a tree that shares their arrays."""
    return GrowingTree(
        feature=nodes.feature,
        threshold=nodes.threshold,
        category=np.full(len(nodes.feature), ALL_VALUES, dtype=np.int32),
        first_child=nodes.first_child,
        n_children=np.where(nodes.feature == LEAF, 0, 2).astype(np.int32),
        counts=nodes.counts,
    )
