"""Whether a tree is grown by compiled code (`depthfirst`) or by numpy (`nodewise`); the results are the same."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import get_args

from graspsense_c45.options import Engine

WORTH_COMPILING = 500_000
"""Values (rows x attributes) of one table from which "auto" chooses the compiled engine at once."""
COMPILING_S = 3.0
"""Processor time for growing trees by numpy, in this process, after which "auto" compiles, which takes 3 to 7 s.
However many fits come, they take at most about twice as long as with the better engine from the beginning."""
LOADING_S = 1.0
"""The same where an earlier process has kept the machine code."""

_NEEDED = ("numba", "graspsense")
"""numba compiles; graspsense keeps the compiled code on disk, under a fingerprint of the code."""


def choose_fast(engine: Engine, n_values: int) -> bool:
    """Return whether to use the compiled engine for so many values.

    "auto" chooses the numpy engine where the compiled one is not installed; see `missing_for_fast`.

    Raises ValueError for an unknown engine, and ModuleNotFoundError where "fast" is not installed.
    """
    if engine not in get_args(Engine):
        raise ValueError(f"engine is {engine!r}; allowed: {', '.join(get_args(Engine))}")
    if engine == "fast" and missing_for_fast():
        raise ModuleNotFoundError(
            f"engine='fast' needs {' and '.join(missing_for_fast())}, which is not installed; "
            "install graspsense-c45[fast] or use engine='numpy'"
        )
    return engine == "fast" or (engine == "auto" and n_values >= WORTH_COMPILING and not missing_for_fast())


class Fits:
    """The fits of this process, by which "auto" chooses the engine of the next one."""

    def __init__(self) -> None:
        self._grown_s = 0.0
        self._kept: bool | None = None

    def choose_fast(self, engine: Engine, n_values: int) -> bool:
        """Return whether to fit a table of so many values by the compiled engine. Raises as `choose_fast` does."""
        if choose_fast(engine, n_values):
            return True
        if engine != "auto" or self._grown_s < LOADING_S or missing_for_fast():
            return False
        return self._grown_s >= COMPILING_S or self._is_kept()

    def add_growing(self, seconds: float) -> None:
        """Count a tree that numpy has grown in so much processor time."""
        self._grown_s += seconds

    def _is_kept(self) -> bool:
        if self._kept is None:
            from graspsense_c45.depthfirst.compiled import kept

            self._kept = kept()
        return self._kept


@cache
def missing_for_fast() -> tuple[str, ...]:
    """Return the packages that the compiled engine needs and that are not installed; with any, "auto" means numpy."""
    return tuple(name for name in _NEEDED if find_spec(name) is None)
