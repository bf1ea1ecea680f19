"""From a table to a tree.

J48 cuts only between values that differ by more than `GAP`, in whatever unit a column has. A column that varies by few
gaps, such as compliances in m/N or capacities in F, has equal values for it. In `fit_scaled` such a column is
multiplied by a power of two, which is exact: the tree is the one in a smaller unit.
"""

from __future__ import annotations

import time

import numpy as np
from attrs import evolve

from graspsense_c45.arrays import Indices, Reals
from graspsense_c45.building.builder import TreeBuilder
from graspsense_c45.building.nodes import Nodes
from graspsense_c45.criteria import GAP
from graspsense_c45.engines import PARTS, Fits
from graspsense_c45.options import J48, Engine, Options
from graspsense_c45.table import MISSING_CLASS, Table
from graspsense_c45.training_set import make_training_set
from graspsense_c45.tree import LEAF, Tree
from graspsense_c45.weka_folds import hold_out

_FITS = Fits()


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
    return _fit_rows(table, options, None, np.arange(0), engine)


def _fit_held_out(table: Table, options: Options, held_out: Indices | None, engine: Engine) -> Tree:
    with_class = np.flatnonzero(table.labels != MISSING_CLASS)
    if held_out is None:
        held_out = with_class[hold_out(table.labels[with_class], options.rep_folds)]
    grown_on = np.setdiff1d(with_class, held_out)
    if not grown_on.size or not table.weights[grown_on].any():
        raise ValueError(
            "all rows are held out, or the others have weight 0; leave some rows to grow the tree on"
        )
    return _fit_rows(table, options, grown_on, np.intersect1d(with_class, held_out), engine)


def _fit_rows(
    table: Table, options: Options, grown_on: Indices | None, held_out: Indices, engine: Engine
) -> Tree:
    """Return a tree that is grown on some rows of a table (None: all), and pruned on others if by reduced error."""
    training = make_training_set(table, grown_on, options)
    n_values = training.values.size * (1 if training.scale.weight_bits == 0 else PARTS)
    compiled = _FITS.choose_fast(engine, n_values, training.slim)
    began = time.thread_time()
    builder = TreeBuilder(training, compiled)
    if options.actual_split_value:
        _use_actual_values(builder.nodes, table.values)
    if options.pruning == "reduced_error":
        builder.prune_reduced_error(table, held_out)
    elif options.collapse:
        builder.collapse()
    if options.pruning == "pessimistic":
        builder.prune_pessimistic()
    if not compiled:
        _FITS.add_plain(time.thread_time() - began)
    return builder.finished(table.schema, options.laplace)


def _use_actual_values(nodes: Nodes, values: Reals) -> None:
    """Replace every midpoint by the largest value of its column that is not above it."""
    feature, threshold = map(np.asarray, (nodes.feature, nodes.threshold))
    for a in np.unique(feature[feature != LEAF]):
        cuts = np.flatnonzero((feature == a) & ~np.isnan(threshold))
        if cuts.size:
            # NaN is sorted to the end, behind every threshold.
            column = np.sort(values[:, a])
            actual = column[np.searchsorted(column, threshold[cuts], side="right") - 1]
            if not actual.all():
                # 0.0 and -0.0 are equal; J48 has the one that comes first in the rows.
                actual[actual == 0.0] = values[np.argmax(values[:, a] == 0.0), a]
            threshold[cuts] = actual


_GAPS = 100
"""Fewest gaps that the values of a column must span to be used as they are."""
_ROUNDING = 1e-13
"""Variation relative to the largest value that is only rounding, and no measurement."""


def fit_scaled(table: Table, options: Options) -> Tree:
    """Return the tree of a table whose columns that vary by little are scaled."""
    doublings = _doublings(table)
    if not doublings.any():
        return fit(table, options)
    tree = fit(evolve(table, values=np.ldexp(table.values, doublings)), options)
    feature, threshold = tree.splits.feature, tree.splits.threshold.copy()
    inner = np.flatnonzero(feature != LEAF)
    threshold[inner] = np.ldexp(threshold[inner], -doublings[feature[inner]])
    return Tree(tree.schema, evolve(tree.splits, threshold=threshold), tree.class_weights, tree.laplace)


def _doublings(table: Table) -> Indices:
    """Return how often each column is doubled: 0 if it is used as it is."""
    doublings = np.zeros(len(table.schema.attributes), dtype=np.int64)
    for k, attribute in enumerate(table.schema.attributes):
        column = table.values[:, k]
        column = column[~np.isnan(column)]
        if attribute.is_nominal or not column.size:
            continue
        span = float(column.max() - column.min())
        if _ROUNDING * float(np.abs(column).max()) < span < _GAPS * GAP:
            doublings[k] = -int(np.floor(np.log2(span)))
    return doublings
