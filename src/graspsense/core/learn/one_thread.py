"""Linear algebra in one thread.

On small tables more threads cost time, and the order of sums would depend on the machine.
"""

from __future__ import annotations

from contextlib import AbstractContextManager
from functools import cache
from typing import TYPE_CHECKING, cast

if TYPE_CHECKING:
    from threadpoolctl import ThreadpoolController


def one_thread() -> AbstractContextManager[object]:
    """Return a context in which scikit-learn, numpy and scipy compute in one thread. Import scikit-learn before."""
    return cast("AbstractContextManager[object]", _libraries().limit(limits=1))


@cache
def _libraries() -> ThreadpoolController:
    """Return the libraries with threads of this process. To find them takes longer than to fit a small model."""
    from threadpoolctl import ThreadpoolController

    return ThreadpoolController()
