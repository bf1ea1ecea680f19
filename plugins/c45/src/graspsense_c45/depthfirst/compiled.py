"""The functions of the compiled engine, compiled (needs numba and graspsense: the extra ``fast``)."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np

from graspsense.simulator_api import CompileOptions, Inlining, compile_function, is_on_disk
from graspsense_c45 import arithmetic, criteria
from graspsense_c45.arrays import Indices, Mask, Reals
from graspsense_c45.depthfirst import growing, pruning, routing, scanning
from graspsense_c45.depthfirst.growing import Columns, Rules
from graspsense_c45.depthfirst.nodes import Nodes, Rows
from graspsense_c45.depthfirst.pruning import Pruning
from graspsense_c45.splits import Splits


def _select(condition: bool, where_true: float, where_false: float) -> float:
    return where_true if condition else where_false


def _mantissa_and_exponent(x: float) -> tuple[float, int]:
    return math.frexp(x)


def _to_integer(x: float) -> Any:
    return np.int64(x)


_OPTIONS = CompileOptions(
    # Division by zero gives inf or NaN, as in numpy.
    error_model="numpy",
    inlining=Inlining(short_code=400, long_code=2000),
    # These do not count references to their array arguments: that took an eighth of the time of growing.
    uncounted=frozenset(
        function.__code__
        for function in (
            criteria.choose_attribute,
            arithmetic.first_maximum,
            growing.best_split,
            growing.best_cut,
            growing.split,
            growing.partition,
            scanning.scan_unit,
            scanning.scan_weighted,
        )
    ),
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


def grow(columns: Columns, averaged: Mask, rules: Rules) -> Nodes:
    """Call `growing.grow` compiled."""
    nodes: Nodes = _compiled(growing.grow)(columns, averaged, rules)
    return nodes


def collapse(nodes: Nodes, margin: int, slack: float) -> None:
    """Call `pruning.collapse` compiled."""
    _compiled(pruning.collapse)(nodes, margin, slack)


def prune(nodes: Nodes, rows: Rows, constants: Pruning) -> None:
    """Call `pruning.prune` compiled."""
    _compiled(pruning.prune)(nodes, rows, constants)


def leaves_of_rows(splits: Splits, values: Reals) -> Indices:
    """Return the leaf that each row comes to from the root; see `routing.leaves`."""
    compiled = _compiled(routing.leaves)
    return np.asarray(
        compiled(splits.feature, splits.threshold, splits.first_child, np.ascontiguousarray(values))
    )
