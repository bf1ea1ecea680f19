"""Damage to a value of JSON, one place at a time: other numbers, other types, lists that are too short or too long.

A model file is data from anywhere, and its hash proves nothing. What reads it must refuse each of these, or answer.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Any, Final

NUMBERS: Final = (
    -1,
    0,
    1,
    2,
    10**6,
    2**31,
    2**32,
    2**63,
    10**30,
    -(10**30),
    -1e-300,
    5e-324,
    0.5,
    1e308,
    -1e308,
)
OTHERS: Final[tuple[Any, ...]] = (
    None,
    True,
    "",
    "x",
    "1",
    [],
    {},
    [[]],
    [1],
    {"a": 1},
    "\x1b[2J",
    math.nan,
    math.inf,
)
_DEEP: Final = 500

Path = tuple[str | int, ...]


def paths(value: Any, path: Path = ()) -> Iterator[Path]:
    """Return the path of this value and of those within it; of a list, those of the first two items and the last."""
    yield path
    if isinstance(value, dict):
        for key, inner in value.items():
            yield from paths(inner, (*path, key))
    elif isinstance(value, list):
        for i in sorted({0, 1, len(value) - 1} & set(range(len(value)))):
            yield from paths(value[i], (*path, i))


def damaged_at(document: Any, path: Path) -> Iterator[Any]:
    """Return copies of a document with other values at this path.

    NaN and infinite numbers, which strict JSON does not have, are among them.
    """
    value = document
    for step in path:
        value = value[step]
    for other in _others(value):
        yield _replaced(document, path, other)


def _others(value: Any) -> Iterator[Any]:
    yield from NUMBERS
    yield from OTHERS
    yield _nested()
    if isinstance(value, bool):
        yield not value
    elif isinstance(value, int | float):
        yield from (-value, value + 1, value * 2)
    elif isinstance(value, str):
        yield value * 2
    elif isinstance(value, list) and value:
        yield from (value[:-1], [*value, value[-1]], value[::-1], value[:1] * len(value), [value], value * 3)
    elif isinstance(value, dict) and value:
        for key in value:
            yield {name: inner for name, inner in value.items() if name != key}
        yield {**value, "further": 1}
        yield dict(zip(value, [*list(value.values())[1:], next(iter(value.values()))], strict=True))


def _nested() -> Any:
    deep: Any = 0
    for _ in range(_DEEP):
        deep = [deep]
    return deep


def _replaced(document: Any, path: Path, other: Any) -> Any:
    if not path:
        return other
    step, *further = path
    inner = _replaced(document[step], tuple(further), other)
    if isinstance(document, dict):
        return {**document, step: inner}
    return [inner if i == step else item for i, item in enumerate(document)]
