"""The functions of the compiled engine, compiled (needs numba and graspsense: the extra ``fast``)."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from graspsense.simulator_api import CompileOptions, compile_function, is_on_disk
from graspsense_c45 import arithmetic
from graspsense_c45.arrays import FixedPoint, Indices, Integer, Reals
from graspsense_c45.depthfirst import growing, pruning, routing
from graspsense_c45.depthfirst.growing import Candidates, Columns, Rules
from graspsense_c45.depthfirst.nodes import Nodes, Rows
from graspsense_c45.depthfirst.pruning import Errors, Pruning
from graspsense_c45.splits import Splits


def _select(condition: bool, where_true: float, where_false: float) -> float:
    return where_true if condition else where_false


def _mantissa_and_exponent(x: float) -> tuple[float, int]:
    return math.frexp(x)


def _to_integer(x: float) -> Any:
    return np.int64(x)


_OPTIONS = CompileOptions(
    # No function makes an array or a list: numba compiles a whole library for those, for longer than these functions.
    counts_references=False,
    # Division by zero gives inf or NaN, as in numpy.
    error_model="numpy",
    replacements={
        arithmetic.select: _select,
        arithmetic.mantissa_and_exponent: _mantissa_and_exponent,
        arithmetic.to_integer: _to_integer,
    },
    install="graspsense-c45[fast]",
)


@cache
def _compiled(function: Any) -> Any:
    return compile_function(function, _OPTIONS)


def kept() -> bool:
    """Return whether the machine code of this engine is on disk, so that its first fit takes a second."""
    return all(is_on_disk(function, _OPTIONS) for function in (growing.grow, pruning.collapse, pruning.prune))


def grow(
    nodes: Nodes, columns: Columns, rules: Rules, candidates: Candidates, workspace: growing.GrowingSpace
) -> int:
    """Call `growing.grow` compiled."""
    return int(_compiled(growing.grow)(nodes, columns, rules, candidates, workspace))


def collapse(nodes: Nodes, errors: FixedPoint, margin: Integer, slack: float) -> None:
    """Call `pruning.collapse` compiled."""
    _compiled(pruning.collapse)(nodes, errors, margin, slack)


def prune(
    nodes: Nodes, rows: Rows, constants: Pruning, errors: Errors, workspace: pruning.PruningSpace
) -> None:
    """Call `pruning.prune` compiled."""
    _compiled(pruning.prune)(nodes, rows, constants, errors, workspace)


def leaves_of_rows(splits: Splits, values: Reals) -> Indices:
    """Return the leaf that each row comes to from the root; see `routing.find_leaves`."""
    leaves = np.empty(len(values), dtype=np.int64)
    _compiled(routing.find_leaves)(
        splits.feature, splits.threshold, splits.first_child, np.ascontiguousarray(values), leaves
    )
    return leaves
