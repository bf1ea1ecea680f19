"""From a table to a tree."""

from __future__ import annotations

from types import ModuleType

import numpy as np
from numpy.typing import NDArray

from graspsense_c45.arithmetic import Array
from graspsense_c45.branches import LEAF, Branches
from graspsense_c45.engines import choose_fast
from graspsense_c45.grow import grow
from graspsense_c45.options import J48, Engine, Options
from graspsense_c45.problem import Problem, pose
from graspsense_c45.prune import collapse, prune_pessimistic, prune_reduced_error
from graspsense_c45.rows_of_one import RowsOfOne
from graspsense_c45.rows_of_weight import RowsOfWeight
from graspsense_c45.table import MISSING_CLASS, Table
from graspsense_c45.tree import Tree, finish
from graspsense_c45.weka_folds import hold_out


def fit(table: Table, options: Options = J48, held_out: Array | None = None, engine: Engine = "auto") -> Tree:
    """Grow and prune a tree; both engines give the same one, to the bit.

    held_out: rows of the table kept for reduced-error pruning; where None, those that J48 would hold out.
    Raises ValueError: rows are held out but the pruning is another one, or no row is left to grow on.
    """
    if options.pruning != "reduced_error":
        if held_out is not None:
            raise ValueError(f"held_out goes with pruning='reduced_error'; pruning is {options.pruning!r}")
        problem = pose(table, None, options)
        fast = _fast(engine, problem)
        branches, rows = fast.grow(problem) if fast else _grow(problem)
        if options.actual_split_value:
            _take_actual_values(branches, table.values)
        if options.collapse:
            fast.collapse(branches, problem) if fast else collapse(branches, problem, rows)
        if options.pruning == "pessimistic":
            (fast.prune_pessimistic if fast else prune_pessimistic)(branches, problem, rows)
        return finish(branches, problem.weight_bits, table.schema, options.laplace)
    with_class = np.flatnonzero(table.labels != MISSING_CLASS)
    if held_out is None:
        held_out = with_class[hold_out(table.labels[with_class], options.rep_folds)]
    grown_on = np.setdiff1d(with_class, held_out)
    if not grown_on.size or not table.weights[grown_on].any():
        raise ValueError(
            "all rows are held out (or the others weigh nothing); leave some to grow the tree on"
        )
    held_out = np.intersect1d(with_class, held_out)
    problem = pose(table, grown_on, options)
    fast = _fast(engine, problem)
    branches, _ = fast.grow(problem) if fast else _grow(problem)
    if options.actual_split_value:
        _take_actual_values(branches, table.values)
    prune_reduced_error(
        branches, problem, table.values[held_out], table.labels[held_out], table.weights[held_out]
    )
    return finish(branches, problem.weight_bits, table.schema, options.laplace)


def _fast(engine: Engine, problem: Problem) -> ModuleType | None:
    """The compiled engine where it is to be used and can grow this tree."""
    if not choose_fast(engine, problem.values.size):
        return None
    from graspsense_c45 import fast

    return fast if fast.takes(problem) else None


def _grow(problem: Problem) -> tuple[Branches, NDArray[np.int32]]:
    level = RowsOfOne(problem) if problem.unit else RowsOfWeight(problem)
    return grow(problem, level), level.leaf_of_row


def _take_actual_values(branches: Branches, values: NDArray[np.float64]) -> None:
    """Replace every midpoint by the largest value of its column not above it."""
    for a in np.unique(branches.attribute[branches.attribute != LEAF]):
        nodes = np.flatnonzero((branches.attribute == a) & ~np.isnan(branches.threshold))
        if nodes.size:
            # NaN sorts to the end, behind every threshold.
            column = np.sort(values[:, a])
            actual = column[np.searchsorted(column, branches.threshold[nodes], side="right") - 1]
            if not actual.all():
                # Of 0.0 and -0.0, which are equal, J48 has the one that comes first in the rows.
                actual[actual == 0.0] = values[np.argmax(values[:, a] == 0.0), a]
            branches.threshold[nodes] = actual
