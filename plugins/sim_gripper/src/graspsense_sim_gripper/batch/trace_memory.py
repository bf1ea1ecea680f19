"""Memory for traces that are kept, in huge pages.

The memory of a kept trace is new to the process, and the system clears each page at its first use. That takes several
times as long as writing the trace, and a third of it where a page has 2 MiB instead of 4 KiB. (A virtual machine that
first has to get the memory from its host gains nothing.)
"""

from __future__ import annotations

import mmap
from collections import deque
from contextlib import suppress
from sys import getrefcount
from typing import Any, Final

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from graspsense_sim_gripper.loop import COLUMNS

HUGE_PAGE: Final = 1 << 21
"""Bytes of a huge page. A block of memory of this size begins at a multiple of it."""
PER_PAGE: Final = 3
"""Traces in a huge page. While one of them is referenced, the memory of all of them is kept."""
TICKS: Final = HUGE_PAGE // (8 * (len(COLUMNS) + 1) * PER_PAGE)
"""Ticks that a trace has room for. It is not a power of two, because all columns would then share one set of the
processor's cache and evict each other."""

MAX_PAGES: Final = 16
"""Pages that are remembered. The memory of a trace is used again if it is dropped within the next 45 grasps."""

TraceArrays = tuple[NDArray[np.float64], NDArray[np.int64]]
"""`Buffers.columns` and `Buffers.phases`."""


@define(eq=False)
class TraceMemory:
    """Gives arrays for the traces of a thread. It gives them again once nothing else references them."""

    _left: list[TraceArrays] = field(factory=list, init=False)
    """The arrays of the last page that were not given yet."""
    _pages: deque[tuple[TraceArrays, ...]] = field(factory=deque, init=False)
    """The last pages, the oldest first."""

    def arrays(self) -> TraceArrays:
        """Return arrays for a trace of `TICKS` ticks. Their numbers are undefined."""
        if not self._left:
            page = self._pages.popleft() if self._pages and _is_free(self._pages[0]) else _new_page()
            if len(self._pages) == MAX_PAGES:
                self._pages.popleft()
            self._pages.append(page)
            self._left = list(page)
        columns, phases = self._left.pop()
        # A tuple of its own, so that whoever holds it references the arrays.
        return columns, phases


def _is_free(page: tuple[TraceArrays, ...]) -> bool:
    """Return whether only the page references its arrays."""
    # Each is referenced by its tuple, and while it is counted by the argument; a trace references it as a base.
    return all(getrefcount(pair[0]) == 2 and getrefcount(pair[1]) == 2 for pair in page)


def _new_page() -> tuple[TraceArrays, ...]:
    """Return arrays in one huge page; in ordinary memory where the system has no huge pages."""
    size, n = TICKS * 8, len(COLUMNS)
    memory: Any = bytearray(HUGE_PAGE) if not hasattr(mmap, "MADV_HUGEPAGE") else _huge_page()
    return tuple(
        (
            np.ndarray((n, TICKS), np.float64, memory, begin),
            np.ndarray((TICKS,), np.int64, memory, begin + n * size),
        )
        for begin in range(0, PER_PAGE * (n + 1) * size, (n + 1) * size)
    )


def _huge_page() -> mmap.mmap:
    page = mmap.mmap(-1, HUGE_PAGE, mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS)
    # A kernel without huge pages refuses this, and gives ordinary ones.
    with suppress(OSError):
        page.madvise(mmap.MADV_HUGEPAGE)
    return page
