"""Which engine does the work; the results are the same."""

from __future__ import annotations

from functools import cache
from importlib.util import find_spec
from typing import get_args

from graspsense_c45.options import Engine

WORTH_COMPILING = 1_000_000
"""From so many values on, ``auto`` takes the compiled engine where it is installed: importing it has paid by then."""


def choose_fast(engine: Engine, n_values: int) -> bool:
    """Whether to use the compiled engine.

    Raises ModuleNotFoundError: it is asked for by name and numba is not installed; ValueError: there is no such engine.
    """
    if engine not in get_args(Engine):
        raise ValueError(f"engine is {engine!r}; allowed: {', '.join(get_args(Engine))}")
    if engine == "fast" and not _is_installed():
        raise ModuleNotFoundError(
            "engine='fast' needs numba, which is not installed; install graspsense-c45[fast] or use engine='numpy'"
        )
    return engine == "fast" or (engine == "auto" and n_values >= WORTH_COMPILING and _is_installed())


@cache
def _is_installed() -> bool:
    return find_spec("numba") is not None
