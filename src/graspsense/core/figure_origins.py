"""Where the number of a model comes from: a closed list, and the published results that a number was fitted to.

What is compared with the paper follows these origins: a result that a number was fitted to is not predicted.
"""

from __future__ import annotations

from typing import Final

ORIGINS: Final = ("measured", "datasheet", "published elsewhere", "assumed")
"""The possible origins of a number, besides a fit."""
FITTED_TO: Final = "fitted to "
"""Begins the origin of a fitted number; the ids of the results follow, separated by commas."""


def fitted_results(origin: str) -> tuple[str, ...]:
    """Return the ids of the results that a number of this origin was fitted to; none if it was not fitted.

    Raises ValueError with the known origins if the text is not one.

    >>> fitted_results("fitted to table_2, table_3")
    ('table_2', 'table_3')
    >>> fitted_results("assumed")
    ()
    """
    if origin in ORIGINS:
        return ()
    results = tuple(origin.removeprefix(FITTED_TO).split(", "))
    if not origin.startswith(FITTED_TO) or not all(one.isidentifier() for one in results):
        raise ValueError(
            f"{origin!r} is not an origin. Known: {', '.join(ORIGINS)}, or {FITTED_TO}the ids of published results"
        )
    return results
