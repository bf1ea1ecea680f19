"""Nominal features, such as a colour: a column of 0 and 1 for each value, with the name `colour=red`.

In this form every classifier can learn from them. `with_codes` is the way back, for a classifier that tests a nominal
feature as a whole.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from attrs import frozen

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from graspsense.core.values.features import FeatureTable

_IS: Final = "="


@frozen
class CodedColumn:
    """A feature of a table: numbers in a unit, or, with `values`, the places of its nominal values."""

    name: str
    unit: str = ""
    values: tuple[str, ...] | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """The names of its columns in a table of features."""
        return (
            (self.name,)
            if self.values is None
            else tuple(value_name(self.name, value) for value in self.values)
        )


def value_name(column: str, value: str) -> str:
    """Return the name of the column that says where a nominal feature has this value."""
    return f"{column}{_IS}{value}"


def splits_of(name: str) -> list[tuple[str, str]]:
    """Return how a name can be read as a nominal feature and its value: at each of its equal signs."""
    places = [i for i, character in enumerate(name) if character == _IS]
    return [(name[:i], name[i + 1 :]) for i in places if i]


def with_codes(table: FeatureTable) -> tuple[tuple[CodedColumn, ...], NDArray[np.float64]]:
    """Return the features of a table with each nominal one as one column of places in `values`, NaN where missing."""
    import numpy as np

    groups: dict[str, list[int]] = {}
    for i, name in enumerate(table.names):
        feature = name.partition(_IS)[0] if splits_of(name) else name
        groups.setdefault(feature, []).append(i)
    columns: list[CodedColumn] = []
    coded: list[NDArray[np.float64]] = []
    for feature, places in groups.items():
        part = table.values[:, places]
        if splits_of(table.names[places[0]]) and _is_nominal(part):
            values = tuple(table.names[i].removeprefix(f"{feature}{_IS}") for i in places)
            columns.append(CodedColumn(feature, values=values))
            coded.append(codes(part))
            continue
        columns += [CodedColumn(table.names[i], table.units[i]) for i in places]
        coded += list(part.T)
    return tuple(columns), np.column_stack(coded) if coded else table.values


def codes_of(columns: Sequence[CodedColumn], table: FeatureTable) -> NDArray[np.float64]:
    """Return these features of a table, nominal ones as places in their values."""
    import numpy as np

    # All columns are picked at once: to look up thousands of names for each takes thousands of times as long.
    picked = table.columns([name for column in columns for name in column.columns]).values
    ends = np.cumsum([len(column.columns) for column in columns])
    parts = [
        part if column.values is None else codes(part)
        for column, part in zip(columns, np.split(picked, ends[:-1], axis=1), strict=True)
    ]
    return np.column_stack(parts)


def codes(part: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the place of the 1 in each row, NaN where a row has none."""
    import numpy as np

    chosen = part == 1.0
    return np.where(chosen.any(axis=1), chosen.argmax(axis=1), np.nan)


def _is_nominal(part: NDArray[np.float64]) -> bool:
    import numpy as np

    known = ~np.isnan(part)
    whole = part[known.all(axis=1)]
    return bool(
        (known.any(axis=1) == known.all(axis=1)).all()
        and np.isin(whole, (0.0, 1.0)).all()
        and (whole.sum(axis=1) == 1.0).all()
    )
