"""A table of trials in a text file: named columns of text and numbers, with the line number of each row.

A name can be followed by its unit: `p_first [m]`; one in round brackets stays a part of the name. A first column
without a name, which pandas writes, is the index.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Iterable, Mapping, Sequence
from copy import copy
from pathlib import Path
from typing import Final, Self

import numpy as np

from graspsense.core.files.csv_text import text_of_cell
from graspsense.core.values.errors import ConfigError, DataDamaged, counted, listed, suggestion
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.label_text import alike_words, is_missing_label, spelled_alike
from graspsense.core.values.nominal import splits_of, value_name
from graspsense.core.values.written_numbers import (
    NotNumbers,
    columns_of_numbers,
    doubts_of_marks,
    is_missing,
    is_number,
)
from graspsense.core.values.written_times import seconds_since_first
from graspsense.sources.formats.table import Numbers
from graspsense.sources.formats.text_table import (
    INDEX,
    distinct_names,
    numbers_with_unit,
    read_lines,
    table_of,
)
from graspsense.sources.units import names_and_units, unit_in

_INDEXES: Final = (INDEX, "Unnamed: 0")
"""The second is the name that pandas gives such a column when it reads it again."""


class CsvColumns:
    """The columns of a CSV file. Raises ConfigError or DataDamaged if the file cannot be read as a table.

    `names` and `units` describe the columns, `cells` holds their text by name, `lines` the line number of each row.
    """

    default_label: str | None = None
    """The column of the label where the file says it; a CSV file does not."""
    index = ""
    """The name of the index that pandas wrote, empty if there is none."""
    _decimal_commas = False
    _numbers: dict[str, Numbers | NotNumbers] | None = None

    def __init__(self, path: Path) -> None:
        self.path = path
        lines, ended = read_lines(path)
        table = table_of(path, lines, ended=ended)
        if not table.names:
            raise DataDamaged(f"{path} is empty: it needs a header line and one line per trial")
        if not table.lines:
            raise DataDamaged(f"{path} has a header but no trials: it needs one line per trial")
        self.notes = table.notes
        self.lines: list[int] = list(table.lines)
        self.units: dict[str, str] = {}
        self.names: list[str] = []
        self.cells: dict[str, list[str]] = {}
        headings = names_and_units([unicodedata.normalize("NFC", text_of_cell(name)) for name in table.names])
        called = distinct_names([name for name, _ in headings])
        renamed: list[str] = []
        for name, (given, unit), unit_of_line, column in zip(
            called, headings, table.units, table.columns, strict=True
        ):
            if not given and not any(column):
                continue
            if not self.names and (not given or name in _INDEXES[1:]):
                self.index = name
            elif name != given:
                renamed.append(name)
            self.names.append(name)
            self.cells[name] = [text_of_cell(cell) for cell in column]
            self.units[name] = numbers_with_unit(self.cells[name], unit or unit_of_line or unit_in(given))[1]
        if 2 * len(renamed) > len(self.names):
            raise DataDamaged(
                f"{path}: most columns have the name of another one, or none, in line {table.named_in}: a table of "
                "trials has a line for each trial, and a column for each feature"
            )
        if renamed:
            self.notes += (f"named here, as columns of one name or of none: {listed(renamed)}",)
        self.levels: dict[str, tuple[str, ...]] = {}
        self._decimal_commas = table.separator == ";"
        self.notes += doubts_of_marks(self.cells, self._read_numbers(), table.separator)

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.lines)

    def column(self, name: str, what: str) -> list[str]:
        """Return the text of a column; `what` says what it is used for. Raises ConfigError if it does not exist."""
        if name not in self.cells:
            raise ConfigError(
                f"{self.path} has no column {name!r} ({what}). Its columns: {listed(self.names)}."
                + suggestion(name, self.names)
                + "".join(f" Note: {note}." for note in self.notes)
            )
        return self.cells[name]

    def complete_column(self, name: str, what: str) -> list[str]:
        """Return a column without missing values. Raises ConfigError, or DataDamaged with the line that has none."""
        cells = self.column(name, what)
        for line, cell in zip(self.lines, cells, strict=True):
            if self.is_missing_text(cell):
                raise DataDamaged(f"{self.path}, line {line}: {name} ({what}) is empty")
        return cells

    def numbers(self, name: str, what: str = "a feature") -> list[float]:
        """Return a column as numbers, NaN where missing. Raises DataDamaged with the line that has another text."""
        self.column(name, what)
        number = self.numbers_or_times(name)
        if isinstance(number, NotNumbers):
            raise DataDamaged(f"{self.path}, line {self.lines[number.row]}: {name} is {number.words}")
        infinite = np.flatnonzero(np.isinf(number))
        if len(infinite):
            raise DataDamaged(
                f"{self.path}, line {self.lines[int(infinite[0])]}: {name} is infinite; leave the cell empty if the "
                "value is missing"
            )
        return list(map(float, number))

    def _read_numbers(self) -> dict[str, Numbers | NotNumbers]:
        if self._numbers is None:
            cells = {name: self._without_unit(name) for name in self.cells}
            self._numbers = columns_of_numbers(cells, decimal_commas=self._decimal_commas)
        return self._numbers

    def take_words_as_missing(self, names: Iterable[str]) -> None:
        """Take a word that repeats in one of these columns of numbers, and is its only one, as missing; note it."""
        for name in names:
            if name in self.cells and not self.is_nominal(name) and self.numbers_or_none(name) is None:
                cells = self._without_unit(name)
                words = [cell for cell in cells if not (is_missing(cell) or is_number(cell))]
                if len(words) > 1 == len(set(words)) and not re.search(r"\d", words[0]):
                    self.cells[name] = ["" if cell == words[0] else cell for cell in cells]
                    self.notes += (
                        f"{words[0]!r} in {counted(len(words), 'cell')} of {name} counts as missing",
                    )
                    self._numbers = None

    def numbers_or_none(self, name: str) -> Numbers | None:
        """Return the numbers of a column, NaN where missing and also infinite; None if a cell is another text."""
        numbers = self._read_numbers()[name]
        return None if isinstance(numbers, NotNumbers) else numbers

    def numbers_or_times(self, name: str) -> Numbers | NotNumbers:
        """Return the numbers of a column, or its times in seconds since the first one, or why it has neither."""
        numbers = self._read_numbers()[name]
        times = seconds_since_first(self.cells[name]) if isinstance(numbers, NotNumbers) else None
        return numbers if times is None else times

    def has_numbers(self, name: str) -> bool:
        """Return whether half of the cells of a column are numbers: a few may be so by chance, as those of hashes."""
        number = self._read_numbers()[name]
        if not isinstance(number, NotNumbers):
            return not np.isnan(number).all()
        given = [cell for cell in self._without_unit(name) if not is_missing(cell)]
        return 2 * sum(map(is_number, given)) >= len(given) > 0

    def _without_unit(self, name: str) -> Sequence[str]:
        return numbers_with_unit(self.cells[name], self.units.get(name, ""))[0]

    def is_blank(self, name: str) -> bool:
        """Return whether every cell of a column is missing."""
        return all(is_missing(cell) for cell in self.cells[name])

    def is_missing_text(self, cell: str) -> bool:
        """Return whether the text of a label or of a nominal value is missing."""
        return is_missing_label(cell)

    def is_nominal(self, name: str) -> bool:
        """Return whether a column has texts instead of numbers, as its header declares or all its cells show."""
        return name in self.levels or not (self.has_numbers(name) or self.is_blank(name))

    def texts(self, name: str) -> list[str]:
        """Return the texts of a column, empty where they are missing."""
        return ["" if self.is_missing_text(cell) else cell for cell in self.cells[name]]

    def values_of(self, name: str) -> tuple[str, ...]:
        """Return the values of a nominal column in the order of its header, or else sorted."""
        return self.levels.get(name) or tuple(sorted(set(self.texts(name)) - {""}))

    def columns_of(self, name: str) -> list[str]:
        """Return the names under which a column is in a table of features: one for each value if it is nominal."""
        if name not in self.cells or not self.is_nominal(name):
            return [name]
        return [value_name(name, value) for value in self.values_of(name)]

    def keep_where(self, wanted: Sequence[bool], why: str) -> list[str]:
        """Remove the other rows, which are trials, and return a note that says why, if there are any."""
        rows = [i for i, is_wanted in enumerate(wanted) if is_wanted]
        left_out = len(self) - len(rows)
        self.keep(rows)
        return [f"{counted(left_out, 'trial')} left out: {why}"] if left_out else []

    def keep(self, rows: Sequence[int]) -> None:
        """Remove all rows but these."""
        self._numbers = None
        self.lines = [self.lines[i] for i in rows]
        self.cells = {name: [cells[i] for i in rows] for name, cells in self.cells.items()}

    def rows(self, rows: Sequence[int]) -> Self:
        """Return the columns of these rows."""
        chosen = copy(self)
        chosen.keep(rows)
        return chosen

    def table(self, names: Sequence[str]) -> FeatureTable:
        """Return these columns as a table of numbers. Raises ConfigError, DataDamaged."""
        known = self._known_values(names)
        columns = [
            self.numbers(name)
            if (split := self._nominal_value(name)) is None
            else self._is_value(*split, known)
            for name in names
        ]
        values = np.array(columns, dtype=np.float64).T
        return FeatureTable(
            names=tuple(names),
            units=tuple(self.units.get(name, "") for name in names),
            values=values.reshape(len(self), len(names)),
        )

    def unknown_values(self, names: Sequence[str]) -> list[str]:
        """Return notes on nominal columns that have other values than these names of features know."""
        notes = []
        for column, known in self._known_values(names).items():
            unknown = [text for text in self.texts(column) if text and text not in known]
            if unknown:
                alike = alike_words(spelled_alike([*unknown, *known]))
                notes.append(
                    f"{column} counts as missing in {counted(len(unknown), 'trial')}: only "
                    f"{listed(sorted(known))} is known of it, and not {listed(sorted(set(unknown)))}"
                    + (f" (differing in spelling only: {alike})" if alike else "")
                )
        return notes

    def _nominal_value(self, name: str) -> tuple[str, str] | None:
        """Return the nominal column and the value that a name such as `colour=red` means; None for another name."""
        if name in self.cells:
            return None
        return next((split for split in splits_of(name) if split[0] in self.cells), None)

    def _known_values(self, names: Sequence[str]) -> dict[str, set[str]]:
        """Return the values of each nominal column that these names of features mean."""
        known: dict[str, set[str]] = {}
        for column, value in filter(None, map(self._nominal_value, names)):
            known.setdefault(column, set()).add(value)
        return known

    def _is_value(self, column: str, value: str, known: Mapping[str, set[str]]) -> list[float]:
        """Return 1 where a nominal column has this value, NaN where it has none of those that are known."""
        return [float(text == value) if text in known[column] else math.nan for text in self.texts(column)]
