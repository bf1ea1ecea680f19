"""Named tuples from the nested lists that JSON makes of them."""

from __future__ import annotations

from typing import Any


def like(pattern: Any, values: Any) -> Any:
    """Return nested lists of values as nested tuples of the same types as `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    if not isinstance(pattern, tuple):
        return values
    parts = [like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)
