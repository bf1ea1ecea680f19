"""Checked access to the values of a stored model.

A model file is data from anywhere. Each value is checked for its type, its range and its size before anything is made
of it, and an error names the field: `model.terms.3.scores: expected a list of 18, found one of 17`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any, Final

from graspsense.core.components.strict import shown
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.features import LARGEST_VALUE

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

LARGEST_SEED: Final = 2**32 - 1
"""The largest seed of a random generator of numpy's older kind, which scikit-learn uses."""
_LARGEST_WHOLE: Final = 2**53
_MOST_SHOWN: Final = 60


class StoredValueError(DataDamaged, ValueError):
    """A value of a stored model that is missing, or is not what its field requires; the message names the field."""


class StoredValues:
    """The values of a table that was read from JSON. Every method raises StoredValueError, which names the field."""

    def __init__(self, values: object, place: str = "") -> None:
        """Take a table. `place` is its field in the file, as errors name it; empty for the whole file."""
        self._place = place
        if not isinstance(values, Mapping):
            raise StoredValueError(f"{place or 'the whole'}: expected a table, found {_shown(values)}")
        self._values = values

    def __contains__(self, key: str) -> bool:
        """Return whether the table has a value for this key."""
        return key in self._values

    def __iter__(self) -> Iterator[str]:
        """Return the keys, in the order of the file."""
        return iter(self._values)

    def as_dict(self) -> dict[str, Any]:
        """Return all values as they are."""
        return dict(self._values)

    def field(self, key: str) -> str:
        """Return the name of a field in errors."""
        return f"{self._place}.{key}" if self._place else key

    def refusal(self, key: str, text: str) -> StoredValueError:
        """Return the error that says what is wrong with a field."""
        return StoredValueError(f"{self.field(key)}: {text}")

    def value(self, key: str) -> Any:
        """Return a value as it is."""
        if key not in self._values:
            raise self.refusal(key, "is missing")
        return self._values[key]

    def table(self, key: str) -> StoredValues:
        """Return a table within this one."""
        return StoredValues(self.value(key), self.field(key))

    def tables(self, key: str) -> list[StoredValues]:
        """Return a list of tables."""
        return [StoredValues(item, f"{self.field(key)}.{i}") for i, item in enumerate(self.items(key))]

    def has(self, key: str) -> bool:
        """Return whether there is a value, and it is not null."""
        return self._values.get(key) is not None

    def items(self, key: str) -> Sequence[Any]:
        """Return a list as it is."""
        items: Sequence[Any] = self._expected(key, lambda value: isinstance(value, list | tuple), "a list")
        return items

    def flag(self, key: str) -> bool:
        """Return true or false."""
        return bool(self._expected(key, lambda value: isinstance(value, bool), "true or false"))

    def text(self, key: str) -> str:
        """Return a text."""
        return str(self._expected(key, _is_text, "text"))

    def choice(self, key: str, allowed: Sequence[str]) -> str:
        """Return one of these texts."""
        return str(self._expected(key, lambda value: value in allowed, f"one of {', '.join(allowed)}"))

    def whole(self, key: str, most: int = _LARGEST_WHOLE) -> int:
        """Return a whole number from 0 to `most`."""
        what = f"a whole number from 0 to {most}"
        return int(self._expected(key, lambda value: type(value) is int and 0 <= value <= most, what))

    def number(self, key: str, least: float = -LARGEST_VALUE, most: float = LARGEST_VALUE) -> float:
        """Return a finite number in this range."""
        what = f"a number from {least:g} to {most:g}"
        return float(
            self._expected(key, lambda value: type(value) in (int, float) and least <= value <= most, what)
        )

    def texts(self, key: str, *, distinct: bool = False) -> tuple[str, ...]:
        """Return a list of texts."""
        given = self._each(key, _is_text, "text")
        if distinct:
            self._refuse_repeated(key, given)
        return tuple(given)

    def wholes(self, key: str) -> list[int]:
        """Return a list of whole numbers, 0 or larger."""
        what = "a whole number of 0 or more"
        return list(self._each(key, lambda value: type(value) is int and 0 <= value <= _LARGEST_WHOLE, what))

    def numbers(
        self, key: str, shape: Sequence[int | None], *, missing: bool = False, least: float = -LARGEST_VALUE
    ) -> NDArray[np.float64]:
        """Return an array of finite numbers from nested lists.

        Every length is compared with `shape` before the array is made; None is any length. With `missing`, null is
        NaN. A number is at least `least`, and not larger than `LARGEST_VALUE`.
        """
        import numpy as np

        kinds = {int, float, type(None)} if missing else {int, float}
        given = self.items(key)
        self._refuse_shape(key, given, shape, kinds)
        try:
            values = np.array(given, dtype=np.float64)
        except (OverflowError, ValueError) as error:
            raise self.refusal(
                key, f"holds something that is not a number of usual size ({error})"
            ) from error
        expected = tuple(len(given) if size is None and i == 0 else size for i, size in enumerate(shape))
        values = (
            values.reshape([0 if size is None else size for size in expected]) if not values.size else values
        )
        known = values[~np.isnan(values)] if missing else values
        if not bool(((known >= least) & (known <= LARGEST_VALUE)).all()):
            raise self.refusal(key, f"holds a number outside of {least:g} to {LARGEST_VALUE:g}")
        return values

    def features(self, key: str) -> tuple[tuple[str, ...], tuple[str, ...]]:
        """Return the names and the units of a list of pairs; at least one, and no name twice."""
        given = self._each(key, _is_pair, "a name and a unit")
        if not given:
            raise self.refusal(key, "expected at least one feature, found none")
        names = [pair[0] for pair in given]
        self._refuse_repeated(key, names)
        return tuple(names), tuple(pair[1] for pair in given)

    def _expected(self, key: str, fits: Callable[[Any], bool], what: str) -> Any:
        """Return a value that fits; `what` says what it is."""
        return self._fitting(key, self.value(key), fits, what)

    def _each(self, key: str, fits: Callable[[Any], bool], what: str) -> Sequence[Any]:
        """Return a list, each value of which fits."""
        return [self._fitting(f"{key}.{i}", value, fits, what) for i, value in enumerate(self.items(key))]

    def _fitting(self, key: str, value: Any, fits: Callable[[Any], bool], what: str) -> Any:
        if not fits(value):
            raise self.refusal(key, f"expected {what}, found {_shown(value)}")
        return value

    def _refuse_repeated(self, key: str, given: Sequence[str]) -> None:
        if len(set(given)) < len(given):
            twice = next(name for name in given if given.count(name) > 1)
            raise self.refusal(key, f"{_shown(twice)} is there twice")

    def _refuse_shape(self, key: str, given: object, shape: Sequence[int | None], kinds: set[type]) -> None:
        if not isinstance(given, list | tuple):
            raise self.refusal(key, f"expected a list, found {_shown(given)}")
        if shape[0] is not None and len(given) != shape[0]:
            raise self.refusal(key, f"does not fit: expected a list of {shape[0]}, found one of {len(given)}")
        if len(shape) > 1:
            for i, item in enumerate(given):
                self._refuse_shape(f"{key}.{i}", item, shape[1:], kinds)
        elif not set(map(type, given)) <= kinds:
            i = next(i for i, item in enumerate(given) if type(item) not in kinds)
            raise self.refusal(f"{key}.{i}", f"expected a number, found {_shown(given[i])}")


def _is_text(value: object) -> bool:
    return isinstance(value, str)


def _is_pair(value: object) -> bool:
    return isinstance(value, list | tuple) and len(value) == 2 and all(map(_is_text, value))


def _shown(value: object) -> str:
    if isinstance(value, int) and abs(value) > _LARGEST_WHOLE:
        return "a whole number of more than 16 digits"
    if isinstance(value, float) and not math.isfinite(value):
        return "a number that is not finite"
    text = shown(value)
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}..."
