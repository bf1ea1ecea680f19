"""Named tuples from the nested lists that JSON makes of them, or from the text of their numbers."""

from __future__ import annotations

from array import array
from base64 import b64decode, b64encode
from collections.abc import Iterator
from typing import Any


def like(pattern: Any, values: Any) -> Any:
    """Return nested lists of values as nested tuples of the same types as `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    if not isinstance(pattern, tuple):
        return values
    parts = [like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)


def text_of(values: tuple[Any, ...]) -> str:
    """Return the numbers in nested tuples as text. That is faster than JSON."""
    return b64encode(array("d", _numbers(values, [])).tobytes()).decode()


def from_text(pattern: Any, text: str) -> Any:
    """Return what `text_of` was given, as nested tuples and numbers of the same types as in `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    numbers = array("d", b64decode(text))
    if len(numbers) != len(_numbers(pattern, [])):
        raise ValueError(f"{len(numbers)} numbers for a state of {len(_numbers(pattern, []))}")
    return _filled(pattern, iter(numbers))


def _numbers(values: tuple[Any, ...], found: list[float]) -> list[float]:
    for value in values:
        if isinstance(value, tuple):
            _numbers(value, found)
        else:
            found.append(value)
    return found


def _filled(pattern: Any, numbers: Iterator[float]) -> Any:
    if not isinstance(pattern, tuple):
        number = next(numbers)
        return int(number) if isinstance(pattern, int) else number
    parts = [_filled(part, numbers) for part in pattern]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)
