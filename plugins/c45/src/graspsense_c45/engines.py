"""Whether a tree is grown by compiled code (`depthfirst`) or by numpy (`nodewise`); the results are the same."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import get_args

from graspsense_c45.options import Engine

WORTH_COMPILING = 500_000
"""Values (rows x attributes) of one table, or of all fits of a process, from which "auto" chooses the compiled engine:
numpy takes as long for so many as compiling does. An evaluation of 900 trials has 1.3 million."""
WORTH_LOADING = 60_000
"""The same where an earlier process has compiled it: loading takes a second."""

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
        self._n_values = 0
        self._kept: bool | None = None

    def choose_fast(self, engine: Engine, n_values: int) -> bool:
        """Return whether to fit a table of so many values by the compiled engine. Raises as `choose_fast` does."""
        if choose_fast(engine, n_values):
            return True
        self._n_values += n_values
        if engine != "auto" or self._n_values < WORTH_LOADING or missing_for_fast():
            return False
        return self._n_values >= WORTH_COMPILING or self._is_kept()

    def _is_kept(self) -> bool:
        if self._kept is None:
            from graspsense_c45.depthfirst.compiled import kept

            self._kept = kept()
        return self._kept


@cache
def missing_for_fast() -> tuple[str, ...]:
    """Return the packages that the compiled engine needs and that are not installed; with any, "auto" means numpy."""
    return tuple(name for name in _NEEDED if find_spec(name) is None)
