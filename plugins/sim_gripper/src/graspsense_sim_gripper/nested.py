"""Nested tuples from an array of their numbers, or from the nested lists that JSON makes of them."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, MutableSequence
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray


@frozen(eq=False)
class Stored:
    """Nested tuples, of which only the numbers are kept until they are read."""

    pattern: Any
    """Tuples of the same types."""
    numbers: NDArray[np.float64]

    def __call__(self) -> Any:
        """Return the tuples."""
        return filled(self.pattern, self.numbers.tolist())


def like(pattern: Any, values: Any) -> Any:
    """Return nested lists of values as nested tuples of the same types as `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    if not isinstance(pattern, tuple):
        return values
    parts = [like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)


def append_numbers(to: MutableSequence[float], values: Any) -> None:
    """Append the numbers in nested tuples, in order; `values` may also be a number."""
    if isinstance(values, tuple):
        for value in values:
            if isinstance(value, tuple):
                append_numbers(to, value)
            else:
                to.append(value)
    else:
        to.append(values)


def count_numbers(values: Any) -> int:
    """Return the number of numbers in nested tuples."""
    return sum(map(count_numbers, values)) if isinstance(values, tuple) else 1


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
