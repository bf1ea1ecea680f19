"""Fits on all cores: the compiled forward model runs without the interpreter's lock."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def in_threads(
    function: Callable[[ItemT], ResultT], items: Sequence[ItemT], done: Callable[[], None] = lambda: None
) -> list[ResultT]:
    """Return the results in the order of the items; `done` is called after each, in this thread."""
    from threadpoolctl import threadpool_limits

    results = []
    # Each fit is on one core. Threads of the linear algebra inside it would wait for each other most of the time.
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for result in pool.map(function, items):
            results.append(result)
            done()
    return results
