"""A file, or a part of it, as named columns: numbers where a column has numbers, text elsewhere."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, Final

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense.core.values.errors import DataDamaged

Numbers = NDArray[np.float64]

MOST_NAMES: Final = 20
"""A text column or a topic with more different names does not say by them what its numbers are of."""


@frozen(kw_only=True)
class TableRules:
    """What a manifest says of the tables in its files.

    `start` is the pattern of the line that begins each in a text, `arrays` that of the names of arrays, whose axes mean
    `axes`. `samples` are the columns of time, gap and forces, `used` those and all others that it uses. With no topics
    among them, all topics of a bag are read.
    """

    start: str = ""
    arrays: str = ""
    axes: tuple[str, ...] = ()
    samples: Collection[str] = ()
    used: Collection[str] = ()


@frozen(kw_only=True, eq=False)
class ColumnTable:
    """The columns of a file or of a part of it.

    `numbers` holds the columns of numbers: shape (n,), or (n, k) for one with k components; a missing value is NaN.
    `texts` holds the others. `fields` are facts that hold for all rows, such as those of a header line or of the
    file's path. `t_s` is the time of each row (s) where the format has one.
    """

    source: str
    """The file, and the part of it, in words."""
    numbers: Mapping[str, Numbers] = field(factory=dict)
    shapes: Mapping[str, tuple[int, ...]] = field(factory=dict)
    """Rows and columns of an image, with the components of a cell if there are several; samples and axes of a fast
    channel."""
    texts: Mapping[str, Sequence[str]] = field(factory=dict)
    fields: Mapping[str, str] = field(factory=dict)
    about: Mapping[str, str] = field(factory=dict)
    """What lines before the table say (`# date: 2026-05-03`), used where nothing else has a name of a manifest."""
    blank: frozenset[str] = frozenset()
    """The names of fields that are empty for this part in a list."""
    t_s: Numbers | None = None
    lines: NDArray[np.int64] | None = None
    """The line of each row in a text file."""
    units: Mapping[str, str] = field(factory=dict)
    """The unit of a column where the file states it: in its name, or in a line of units."""
    notes: tuple[str, ...] = ()
    """What was left out of the file, or chosen, on reading it."""
    warnings: tuple[str, ...] = ()
    """What has to be confirmed, or looks wrong."""
    not_numbers: Mapping[str, str] = field(factory=dict)
    """For a column of text that begins with a number: its first line with another text, in words."""

    damage: str = ""
    """Why this part of a file cannot be read, where the others can."""
    delays_s: Mapping[str, float] = field(factory=dict)
    """For each topic of a bag, the least time from the header of a message to its recording (s); empty where the times
    of headers are not used."""

    def __len__(self) -> int:
        """Return the number of rows."""
        for column in (*self.numbers.values(), *self.texts.values()):
            return len(column)
        return 0

    def value(self, name: str) -> str | None:
        """Return the only value of a field or of a column as text, or what the file says; None if there is neither.

        Raises DataDamaged if the column has several values.
        """
        if name in self.fields:
            return self.fields[name]
        if name in self.texts:
            values = set(self.texts[name])
        elif name in self.numbers and self.numbers[name].ndim == 1:
            values = {_shown(float(number)) for number in np.unique(self.numbers[name])}
        else:
            return self.about.get(name)
        if len(values) != 1:
            some = ", ".join(sorted(values)[:4])
            raise DataDamaged(
                f"{self.source}: column {name!r} has {len(values)} values ({some}, ...) in one squeeze, so it cannot "
                f'name it. Split the file by it: split = "{name}"'
            )
        return values.pop()

    def rows(self, which: Any, part: str = "") -> ColumnTable:
        """Return these rows (a slice, numbers, or a mask); `part` says in words which they are."""
        index = np.arange(len(self))[which].tolist() if self.texts else []
        return evolve(
            self,
            source=f"{self.source}, {part}" if part else self.source,
            numbers={name: values[which] for name, values in self.numbers.items()},
            texts={name: [values[i] for i in index] for name, values in self.texts.items()},
            t_s=None if self.t_s is None else self.t_s[which],
            lines=None if self.lines is None else self.lines[which],
        )

    def with_fields(self, fields: Mapping[str, str]) -> ColumnTable:
        """Return the table with these facts beside its own."""
        return evolve(self, fields={**fields, **self.fields})


def _shown(value: float) -> str:
    return str(int(value)) if value.is_integer() and abs(value) < 1e15 else repr(value)
