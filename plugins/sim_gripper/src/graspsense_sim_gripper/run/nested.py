"""Nested tuples and the numbers in them."""

from __future__ import annotations

from collections.abc import Iterator, MutableSequence, Sequence
from typing import Any

import numpy as np
from attrs import define, frozen
from numpy.typing import NDArray


@define(eq=False)
class TupleType:
    """The types of nested tuples of numbers, from which such tuples are made of their numbers."""

    pattern: Any
    """Nested tuples of these types, or a number. It may hold arrays, if only compiled code makes tuples of it."""
    count: int
    """Number of numbers."""
    compiled_type: Any = None
    """The type in compiled code that stands for this one, once it is known."""

    @classmethod
    def made_of(cls, pattern: Any) -> TupleType:
        """Return the type of these nested tuples; `pattern` may also be a number."""
        return cls(pattern, count_numbers(pattern))

    def filled(self, numbers: Sequence[float] | NDArray[np.float64]) -> Any:
        """Return these numbers as nested tuples. Raises ValueError if there are more or fewer than in the type."""
        if len(numbers) != self.count:
            raise ValueError(f"{len(numbers)} numbers for nested tuples of {self.count}")
        return _filled(self.pattern, iter(numbers.tolist() if isinstance(numbers, np.ndarray) else numbers))


def _filled(pattern: Any, numbers: Iterator[float]) -> Any:
    """Return the next numbers as nested tuples of the types of `pattern`."""
    if isinstance(pattern, tuple):
        # `tuple.__new__` makes named tuples in half of the time of their constructors.
        return tuple.__new__(type(pattern), [_filled(part, numbers) for part in pattern])
    return type(pattern)(next(numbers))


@frozen(eq=False)
class Stored:
    """Nested tuples, of which only the numbers are kept until they are read."""

    type: TupleType
    numbers: NDArray[np.float64]

    def __call__(self) -> Any:
        """Return the tuples."""
        return self.type.filled(self.numbers)


def structure(values: Any) -> Any:
    """Return nested types, which are equal for nested tuples of equal types."""
    if isinstance(values, tuple):
        return (type(values), *map(structure, values))
    return (values.dtype.str, values.ndim) if isinstance(values, np.ndarray) else type(values)


def with_places(pattern: Any, begin: int = 0) -> Any:
    """Return nested tuples like `pattern`, in which each number is its place among all numbers, counted from `begin`.

    Arrays are no numbers, and are kept.
    """
    if isinstance(pattern, np.ndarray):
        return pattern
    if not isinstance(pattern, tuple):
        return begin
    parts = []
    for part in pattern:
        parts.append(with_places(part, begin))
        begin += count_numbers(part)
    return tuple.__new__(type(pattern), parts)


def taken(places: Any, numbers: Sequence[float]) -> Any:
    """Return nested tuples like `places`, in which each place is replaced by the number there."""
    if isinstance(places, tuple):
        return tuple.__new__(type(places), [taken(part, numbers) for part in places])
    return numbers[places]


def append(values: Any, numbers: MutableSequence[float], arrays: list[NDArray[Any]]) -> None:
    """Append the numbers and the arrays in nested tuples, in order; `values` may also be a number."""
    if isinstance(values, tuple):
        for value in values:
            append(value, numbers, arrays)
    elif isinstance(values, np.ndarray):
        arrays.append(values)
    else:
        numbers.append(values)


def count_numbers(values: Any) -> int:
    """Return the number of numbers in nested tuples, without arrays."""
    if isinstance(values, tuple):
        return sum(map(count_numbers, values))
    return 0 if isinstance(values, np.ndarray) else 1
