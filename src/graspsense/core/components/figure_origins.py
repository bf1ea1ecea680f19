"""Where the number of a model comes from: a closed list, and the published results that a number was fitted to.

What is compared with the paper follows these origins: a result that a number was fitted to is not predicted. Nor is a
claim that a number gives by itself, such as static friction that a commanded force below it moves nothing.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

import attrs

ORIGINS: Final = ("measured", "datasheet", "published elsewhere", "assumed")
"""The possible origins of a number, besides a fit."""
FITTED_TO: Final = "fitted to "
"""Begins the origin of a fitted number; the ids of the results follow, separated by commas."""
_GIVES: Final = "graspsense.gives"


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
    if not origin.startswith(FITTED_TO) or not all(result.isidentifier() for result in results):
        raise ValueError(
            f"{origin!r} is not an origin. Known: {', '.join(ORIGINS)}, or {FITTED_TO}the ids of published results"
        )
    return results


def gives(claim: str) -> Mapping[str, str]:
    """Return the metadata of the attrs field of a number which, unless it is 0, gives this claim by itself."""
    return {_GIVES: claim}


def given_claims(values: Any) -> frozenset[str]:
    """Return the ids of the claims that numbers of this attrs instance give by themselves; none for other values."""
    if not attrs.has(type(values)):
        return frozenset()
    return frozenset(
        field.metadata[_GIVES]
        for field in attrs.fields(type(values))
        if _GIVES in field.metadata and getattr(values, field.name) != 0
    )
