"""Whether compiled code or the interpreter grows a tree; both run the same functions, with the same result."""

from __future__ import annotations

import os
import sys
from functools import cache
from importlib.util import find_spec
from typing import get_args

from graspsense_c45.options import Engine

WORTH_COMPILING = 500_000
"""Values (rows x attributes) of one table from which "auto" compiles at once."""
PARTS = 5
"""How many values one counts for where rows have fractional weights, as parts of rows have: their terms take longer."""
COMPILING_S = 1.0
"""Processor time for trees by the interpreter, in this process, after which "auto" compiles, which takes 4 to 7 s.
That is a loss where few trees would follow, once: the machine code is kept, and later processes have it."""
LOADING_S = 0.5
"""The same where an earlier process has kept the machine code, for the import of numba."""

_NEEDED = ("numba", "graspsense")
"""numba compiles; graspsense keeps the compiled code on disk, under a fingerprint of the code."""


class Fits:
    """The fits of this process, by which "auto" chooses the engine of the next one."""

    def __init__(self) -> None:
        self._plain_s = 0.0
        self._kept: dict[bool, bool] = {}

    def choose_fast(self, engine: Engine, n_values: int, slim: bool) -> bool:
        """Return whether to fit a table of so many values by compiled code; slim: see `building.compiled`.

        "auto" does not where it cannot be compiled: see `missing_for_fast`, or because numba is switched off.

        Raises ValueError for an unknown engine, and ModuleNotFoundError where "fast" is not installed.
        """
        if engine not in get_args(Engine):
            raise ValueError(f"engine is {engine!r}; allowed: {', '.join(get_args(Engine))}")
        if engine == "fast" and missing_for_fast():
            raise ModuleNotFoundError(
                f"engine='fast' needs {' and '.join(missing_for_fast())}, which is not installed; "
                "install graspsense-c45[fast] or use engine='plain'"
            )
        if engine != "auto" or missing_for_fast() or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            return engine == "fast"
        loading_s = 0.0 if "numba" in sys.modules else LOADING_S
        worth = n_values >= WORTH_COMPILING or self._plain_s >= max(COMPILING_S, loading_s)
        return worth or (self._plain_s >= loading_s and self._is_kept(slim))

    def add_plain(self, seconds: float) -> None:
        """Count a tree that took the interpreter so much processor time."""
        self._plain_s += seconds

    def _is_kept(self, slim: bool) -> bool:
        if slim not in self._kept:
            from graspsense_c45.building.compiled import kept

            self._kept[slim] = kept(slim)
        return self._kept[slim]


@cache
def missing_for_fast() -> tuple[str, ...]:
    """Return the packages that compiling needs and that are not installed; with any, "auto" means plain."""
    return tuple(name for name in _NEEDED if find_spec(name) is None)
