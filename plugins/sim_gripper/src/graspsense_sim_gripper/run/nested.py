"""Nested tuples and the numbers in them: from an array of these, or from the nested lists that JSON makes of them."""

from __future__ import annotations

from collections.abc import Callable, MutableSequence, Sequence
from itertools import groupby
from operator import itemgetter
from typing import Any

import numpy as np
from attrs import define, frozen
from numpy.typing import NDArray


@frozen(eq=False)
class TupleType:
    """The types of nested tuples of numbers, from which such tuples are made of their numbers."""

    count: int
    """Number of numbers."""
    _others: tuple[tuple[int, type], ...]
    """The place and the type of each number that is no float."""
    _make: Callable[[list[Any]], Any]

    @classmethod
    def of(cls, pattern: Any) -> TupleType:
        """Return the type of these nested tuples; `pattern` may also be a number."""
        leaves: list[Any] = []
        append_numbers(leaves, pattern)
        others = tuple((i, type(leaf)) for i, leaf in enumerate(leaves) if type(leaf) is not float)
        make = _maker(pattern, 0) if isinstance(pattern, tuple) else itemgetter(0)
        return cls(len(leaves), others, make)

    def filled(self, numbers: Sequence[float] | NDArray[np.float64]) -> Any:
        """Return these numbers as nested tuples. Raises ValueError if there are more or fewer than in the type."""
        if len(numbers) != self.count:
            raise ValueError(f"{len(numbers)} numbers for nested tuples of {self.count}")
        leaves = numbers.tolist() if isinstance(numbers, np.ndarray) else list(numbers)
        for i, kind in self._others:
            leaves[i] = kind(leaves[i])
        return self._make(leaves)


@define(eq=False)
class Pattern:
    """Nested tuples of numbers and arrays that stand for their types only."""

    values: Any
    compiled_type: Any = None
    """Their type in compiled code, once it is known."""


@frozen(eq=False)
class Stored:
    """Nested tuples, of which only the numbers are kept until they are read."""

    type: TupleType
    numbers: NDArray[np.float64]

    def __call__(self) -> Any:
        """Return the tuples."""
        return self.type.filled(self.numbers)


def _maker(pattern: tuple[Any, ...], begin: int) -> Callable[[list[Any]], Any]:
    """Return what makes a tuple of the type of `pattern` of the numbers from `begin` on, in a list of numbers."""
    # `tuple.__new__` makes named tuples in half of the time of their constructors.
    new, kind, makers = tuple.__new__, type(pattern), []
    at = begin
    for is_tuple, parts in groupby(pattern, lambda part: isinstance(part, tuple)):
        for part in parts if is_tuple else [tuple(parts)]:
            end = at + count_numbers(part)
            makers.append((at, end, _maker(part, at) if is_tuple else None))
            at = end
    if at == begin:
        # A tuple without numbers is always the same.
        return lambda numbers: pattern
    if all(make is None for _, _, make in makers):
        return lambda numbers: new(kind, numbers[begin:at])

    def made(numbers: list[Any]) -> Any:
        fields: list[Any] = []
        for first, last, make in makers:
            if make is None:
                fields += numbers[first:last]
            else:
                fields.append(make(numbers))
        return new(kind, fields)

    return made


def structure(values: Any) -> Any:
    """Return nested types, which are equal for nested tuples of equal types."""
    if isinstance(values, tuple):
        return (type(values), *map(structure, values))
    return (values.dtype.str, values.ndim) if isinstance(values, np.ndarray) else type(values)


Append = Callable[[Any, MutableSequence[float], list[NDArray[Any]]], None]
"""`append(values, numbers, arrays)` appends the numbers and the arrays in nested tuples, in order."""


def appender(pattern: tuple[Any, ...]) -> Append:
    """Return what appends the numbers and the arrays of nested tuples of the same types as `pattern`."""
    parts: list[tuple[int, int, Append | None]] = []
    begin = 0
    for kind, group in groupby(pattern, _kind):
        for part in group if kind is not float else [tuple(group)]:
            end = begin + (len(part) if kind is float else 1)
            parts.append(
                (begin, end, None if kind is float else appender(part) if kind is tuple else _append_array)
            )
            begin = end
    if len(parts) == 1 and parts[0][2] is None:
        return _append_all

    def append(values: Any, numbers: MutableSequence[float], arrays: list[NDArray[Any]]) -> None:
        for first, last, one in parts:
            if one is None:
                numbers.extend(values[first:last])
            else:
                one(values[first], numbers, arrays)

    return append


def _kind(part: Any) -> type:
    return tuple if isinstance(part, tuple) else np.ndarray if isinstance(part, np.ndarray) else float


def _append_all(values: Any, numbers: MutableSequence[float], arrays: list[NDArray[Any]]) -> None:
    numbers.extend(values)


def _append_array(values: Any, numbers: MutableSequence[float], arrays: list[NDArray[Any]]) -> None:
    arrays.append(values)


def like(pattern: Any, values: Any) -> Any:
    """Return nested lists of values as nested tuples of the same types as `pattern`.

    Raises ValueError if the numbers of values differ.
    """
    if not isinstance(pattern, tuple):
        return values
    parts = [like(*one) for one in zip(pattern, values, strict=True)]
    return type(pattern)(*parts) if hasattr(pattern, "_fields") else tuple(parts)


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


def first_place(places: Any) -> int:
    """Return the first of nested places; 0 if there is none."""
    while isinstance(places, tuple):
        if not places:
            return 0
        places = places[0]
    return int(places)


def append_numbers(to: MutableSequence[float], values: Any) -> None:
    """Append the numbers in nested tuples without arrays, in order; `values` may also be a number."""
    if not isinstance(values, tuple):
        to.append(values)
        return
    for value in values:
        if isinstance(value, tuple):
            append_numbers(to, value)
        else:
            to.append(value)


def count_numbers(values: Any) -> int:
    """Return the number of numbers in nested tuples, without arrays."""
    if isinstance(values, tuple):
        return sum(map(count_numbers, values))
    return 0 if isinstance(values, np.ndarray) else 1
