"""From a table to a tree."""

from __future__ import annotations

import time
from typing import Protocol

import numpy as np

from graspsense_c45.arrays import Indices, Reals
from graspsense_c45.engines import Fits
from graspsense_c45.nodewise.builder import NodewiseTreeBuilder
from graspsense_c45.nodewise.reduced_error import prune_reduced_error
from graspsense_c45.options import J48, Engine, Options
from graspsense_c45.splits import LEAF, GrowingTree
from graspsense_c45.table import MISSING_CLASS, Table
from graspsense_c45.training_set import TrainingSet, make_training_set
from graspsense_c45.tree import Tree, finish
from graspsense_c45.weka_folds import hold_out

_FITS = Fits()


class TreeBuilder(Protocol):
    """What a form of the builder does: it grows a tree when it is made, and prunes it on request."""

    tree: GrowingTree

    def collapse(self) -> None:
        """Make leaves of subtrees that hardly save training errors."""

    def prune_pessimistic(self) -> None:
        """Prune by estimated errors, after collapsing if at all."""


def fit(
    table: Table, options: Options = J48, held_out: Indices | None = None, engine: Engine = "auto"
) -> Tree:
    """Return a tree that is grown and pruned; compiled or not, it is the same tree, to the bit.

    held_out: rows of the table for reduced-error pruning; by default those that J48 would hold out.

    Raises ValueError if rows are held out for another pruning, and where no row is left to grow on.
    Raises ModuleNotFoundError if `engine` is "fast" and that engine is not installed.
    """
    if options.pruning == "reduced_error":
        return _fit_held_out(table, options, held_out, engine)
    if held_out is not None:
        raise ValueError(f"held_out goes with pruning='reduced_error'; pruning is {options.pruning!r}")
    training = make_training_set(table, None, options)
    builder = _builder(training, engine)
    if options.actual_split_value:
        _use_actual_values(builder.tree, table.values)
    if options.collapse:
        builder.collapse()
    if options.pruning == "pessimistic":
        builder.prune_pessimistic()
    return finish(builder.tree, training.scale.weight_bits, table.schema, options.laplace)


def _fit_held_out(table: Table, options: Options, held_out: Indices | None, engine: Engine) -> Tree:
    with_class = np.flatnonzero(table.labels != MISSING_CLASS)
    if held_out is None:
        held_out = with_class[hold_out(table.labels[with_class], options.rep_folds)]
    grown_on = np.setdiff1d(with_class, held_out)
    if not grown_on.size or not table.weights[grown_on].any():
        raise ValueError(
            "all rows are held out, or the others have weight 0; leave some rows to grow the tree on"
        )
    training = make_training_set(table, grown_on, options)
    tree = _builder(training, engine).tree
    if options.actual_split_value:
        _use_actual_values(tree, table.values)
    prune_reduced_error(tree, training, table, np.intersect1d(with_class, held_out))
    return finish(tree, training.scale.weight_bits, table.schema, options.laplace)


def _builder(training: TrainingSet, engine: Engine) -> TreeBuilder:
    """Return the compiled builder where it is wanted and can build this tree, else the plain one."""
    if _FITS.choose_fast(engine, training.values.size):
        from graspsense_c45.depthfirst.builder import DepthFirstTreeBuilder

        if DepthFirstTreeBuilder.can_build(training):
            return DepthFirstTreeBuilder(training)
    began = time.thread_time()
    builder = NodewiseTreeBuilder(training)
    _FITS.add_growing(time.thread_time() - began)
    return builder


def _use_actual_values(tree: GrowingTree, values: Reals) -> None:
    """Replace every midpoint by the largest value of its column that is not above it."""
    for a in np.unique(tree.feature[tree.feature != LEAF]):
        nodes = np.flatnonzero((tree.feature == a) & ~np.isnan(tree.threshold))
        if nodes.size:
            # NaN is sorted to the end, behind every threshold.
            column = np.sort(values[:, a])
            actual = column[np.searchsorted(column, tree.threshold[nodes], side="right") - 1]
            if not actual.all():
                # 0.0 and -0.0 are equal; J48 has the one that comes first in the rows.
                actual[actual == 0.0] = values[np.argmax(values[:, a] == 0.0), a]
            tree.threshold[nodes] = actual
