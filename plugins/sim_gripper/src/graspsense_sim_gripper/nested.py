"""Nested tuples from an array of their numbers, or from the nested lists that JSON makes of them."""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from operator import itemgetter
from typing import Any

import numpy as np
from attrs import frozen
from numpy.typing import NDArray


@frozen(eq=False)
class TupleType:
    """The types of nested tuples of numbers, from which such tuples are made of their numbers."""

    count: int
    """Number of numbers."""
    _make: Callable[[list[float]], Any]

    @classmethod
    def of(cls, pattern: Any) -> TupleType:
        """Return the type of these nested tuples; `pattern` may also be a number."""
        make, count = _maker(pattern, 0)
        return cls(count, make)

    def filled(self, numbers: Sequence[float] | NDArray[np.float64]) -> Any:
        """Return these numbers as nested tuples. Raises ValueError if there are more or fewer than in the type."""
        if len(numbers) != self.count:
            raise ValueError(f"{len(numbers)} numbers for nested tuples of {self.count}")
        return self._make(numbers.tolist() if isinstance(numbers, np.ndarray) else list(numbers))


@frozen(eq=False)
class Stored:
    """Nested tuples, of which only the numbers are kept until they are read."""

    type: TupleType
    numbers: NDArray[np.float64]

    def __call__(self) -> Any:
        """Return the tuples."""
        return self.type.filled(self.numbers)


def _maker(pattern: Any, begin: int) -> tuple[Callable[[list[float]], Any], int]:
    """Return what makes a value of the type of `pattern` of the numbers from `begin` on, and where these end."""
    kind, end = type(pattern), begin
    if not isinstance(pattern, tuple):
        if kind is float:
            return itemgetter(begin), begin + 1
        return lambda numbers: kind(numbers[begin]), begin + 1
    makers = []
    for part in pattern:
        make, end = _maker(part, end)
        makers.append(make)
    # `tuple.__new__` makes named tuples in half of the time of their constructors.
    new = tuple.__new__
    if all(type(part) is float for part in pattern):
        return lambda numbers: new(kind, numbers[begin:end]), end
    return lambda numbers: new(kind, [make(numbers) for make in makers]), end


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
