"""Suspending Python's cyclic garbage collector where its pauses do harm.

Once a process has imported what a grasp needs, a full collection takes tens of milliseconds, which is several ticks.
"""

from __future__ import annotations

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final

_LOCK: Final = threading.Lock()
_COLLECTED: Final[list[bool]] = []
"""Whether garbage was collected before, once for each context in which it is not."""


@contextmanager
def no_collection() -> Iterator[None]:
    """Suspend garbage collection in this process.

    Contexts may be nested, and may overlap in several threads; the last that ends restores what was before the first.
    """
    with _LOCK:
        _COLLECTED.append(_COLLECTED[0] if _COLLECTED else gc.isenabled())
        gc.disable()
    try:
        yield
    finally:
        with _LOCK:
            if _COLLECTED.pop() and not _COLLECTED:
                gc.enable()


@contextmanager
def present_objects_kept() -> Iterator[None]:
    """Leave the objects that exist now out of garbage collection, which then takes well below a tick.

    For a process that runs for hours and cannot suspend collection.
    """
    gc.freeze()
    try:
        yield
    finally:
        gc.unfreeze()
