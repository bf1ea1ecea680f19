"""Which engine grows a tree and predicts; the results are the same."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import get_args

from graspsense_c45.options import Engine

WORTH_COMPILING = 1_000_000
"""Values (rows x attributes) from which "auto" chooses the compiled engine, because importing it then pays."""

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


@cache
def missing_for_fast() -> tuple[str, ...]:
    """Return the packages that the compiled engine needs and that are not installed; with any, "auto" means numpy."""
    return tuple(name for name in _NEEDED if find_spec(name) is None)
