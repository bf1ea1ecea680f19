"""Nested tuples from a list of their numbers, or from the nested lists that JSON makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import Any


def like(pattern: Any, values: Any) -> Any:
    """Return nested lists of values as nested tuples of the same types as `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    if not isinstance(pattern, tuple):
        return values
    parts = [like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)


def append_numbers(to: list[float], values: Any) -> None:
    """Append the numbers in nested tuples, in order; `values` may also be a number."""
    if isinstance(values, tuple):
        for value in values:
            if isinstance(value, tuple):
                append_numbers(to, value)
            else:
                to.append(value)
    else:
        to.append(values)


def filled(pattern: Any, numbers: Iterable[float]) -> Any:
    """Return numbers as nested tuples and numbers of the same types as in `pattern`.

    Raises ValueError if there are more or fewer numbers than in the pattern.
    """
    rest = iter(numbers)
    try:
        values = _filled(pattern, rest)
    except StopIteration:
        raise ValueError("fewer numbers than in the pattern") from None
    if next(rest, None) is not None:
        raise ValueError("more numbers than in the pattern")
    return values


def _filled(pattern: Any, numbers: Iterator[float]) -> Any:
    if not isinstance(pattern, tuple):
        return type(pattern)(next(numbers))
    parts = [_filled(part, numbers) for part in pattern]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)
