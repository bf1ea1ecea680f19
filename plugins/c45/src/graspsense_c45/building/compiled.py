"""The functions of the builder, compiled (needs numba and graspsense: the extra ``fast``)."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from graspsense.simulator_api import CompileOptions, compile_function, is_on_disk
from graspsense_c45 import arithmetic
from graspsense_c45.arrays import Indices, Reals
from graspsense_c45.building import growing, leaves
from graspsense_c45.splits import Splits

_OPTIONS = CompileOptions(
    # No function makes an array or a list: numba compiles a whole library for those, for longer than these functions.
    counts_references=False,
    # Division by zero is not looked for: the rules do not divide by zero.
    error_model="numpy",
    replacements={arithmetic.term: arithmetic.new_term},
    install="graspsense-c45[fast]",
)


@cache
def compiled(function: Any) -> Any:
    """Return a function of the builder, compiled."""
    return compile_function(function, _OPTIONS)


def kept() -> bool:
    """Return whether the machine code that grows a tree is on disk."""
    return is_on_disk(growing.grow, _OPTIONS)


def leaves_of_rows(splits: Splits, values: Reals) -> Indices:
    """Return the leaf that each row comes to from the root; see `leaves.find_leaves`."""
    found = np.empty(len(values), dtype=np.int64)
    compiled(leaves.find_leaves)(
        splits.feature, splits.threshold, splits.first_child, np.ascontiguousarray(values), found
    )
    return found
