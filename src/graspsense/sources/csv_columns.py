"""A CSV file as named columns of text, with the line number of each row.

Text is UTF-8. Columns are separated by the character among comma, semicolon and tab that occurs most often in the
header. Numbers have a decimal point. A name can be followed by its unit: `p_first [m]`. Empty cells, `nan`, `NA`,
`null` and `?` are missing values.
"""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import numpy as np

from graspsense.core.files.csv_text import text_of_cell
from graspsense.core.files.limits import CELLS, COLUMNS, LINE_CHARACTERS, TEXT_BYTES
from graspsense.core.learn.target_value import name_and_unit
from graspsense.core.values.errors import ConfigError, DataDamaged, listed, suggestion
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.nominal import splits_of, value_name
from graspsense.recording.readable import not_opened, refuse_devices

LONGEST_NAME: Final = 500
"""Limit on the characters of the name of a column."""
_LINE_ENDS: Final = "\n\r\v\f\x1c\x1d\x1e\x85\u2028\u2029"
"""The characters at which `str.splitlines` divides a text."""
_MISSING: Final = frozenset({"", "nan", "na", "n/a", "null", "none", "?"})
_DECIMAL_COMMA: Final = re.compile(r"[-+]?\d+,\d+")


class CsvColumns:
    """The columns of a CSV file. Raises ConfigError or DataDamaged if the file cannot be read as a table.

    `names` and `units` describe the columns, `cells` holds their text by name, `lines` the line number of each row.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        header, self.lines, rows = _rows(path, text_of(path))
        self.units: dict[str, str] = {}
        self.names: list[str] = []
        for heading in header:
            name, unit = name_and_unit(heading)
            if not name:
                raise DataDamaged(f"{path}: column {len(self.names) + 1} has no name in the header")
            if name in self.units:
                raise DataDamaged(f"{path}: two columns are named {name!r}: rename one")
            self.names.append(name)
            self.units[name] = unit
        self.cells = {name: [row[k] for row in rows] for k, name in enumerate(self.names)}
        self.levels: dict[str, tuple[str, ...]] = {}

    @property
    def default_label(self) -> str | None:
        """The column of the label where the file says it; a CSV file does not."""
        return None

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.lines)

    def column(self, name: str, what: str) -> list[str]:
        """Return the text of a column; `what` says what it is used for. Raises ConfigError if it does not exist."""
        if name not in self.cells:
            raise ConfigError(
                f"{self.path} has no column {name!r} ({what}). Its columns: {listed(self.names)}."
                + suggestion(name, self.names)
            )
        return self.cells[name]

    def complete_column(self, name: str, what: str) -> list[str]:
        """Return a column without missing values. Raises ConfigError, or DataDamaged with the line that has none."""
        cells = self.column(name, what)
        for line, cell in zip(self.lines, cells, strict=True):
            if self.is_missing_text(cell):
                raise DataDamaged(f"{self.path}, line {line}: {name} ({what}) is empty")
        return cells

    def numbers(self, name: str) -> list[float]:
        """Return a column as numbers, NaN where missing. Raises DataDamaged with the line that has another text."""
        values = []
        for line, cell in zip(self.lines, self.column(name, "a feature"), strict=True):
            if is_missing(cell):
                values.append(math.nan)
                continue
            try:
                value = float(cell.replace("_", "x"))  # Python would read 1_0 as 10
            except ValueError:
                hint = " (write a decimal point)" if _DECIMAL_COMMA.fullmatch(cell) else ""
                raise DataDamaged(
                    f"{self.path}, line {line}: {name} is {cell[:40]!r}, which is not a number{hint}"
                ) from None
            if math.isinf(value):
                raise DataDamaged(
                    f"{self.path}, line {line}: {name} is infinite; leave the cell empty if the value is missing"
                )
            values.append(value)
        return values

    def has_numbers(self, name: str) -> bool:
        """Return whether any cell of a column is a finite number."""
        return any(_is_number(cell) for cell in self.cells[name])

    def is_blank(self, name: str) -> bool:
        """Return whether every cell of a column is missing."""
        return all(is_missing(cell) for cell in self.cells[name])

    def is_missing_text(self, cell: str) -> bool:
        """Return whether the text of a label or of a nominal value is missing."""
        return is_missing(cell) and cell.lower() != "none"

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

    def keep(self, rows: Sequence[int]) -> None:
        """Remove all rows but these."""
        self.lines = [self.lines[i] for i in rows]
        self.cells = {name: [cells[i] for i in rows] for name, cells in self.cells.items()}

    def table(self, names: Sequence[str]) -> FeatureTable:
        """Return these columns as a table of numbers. Raises ConfigError, DataDamaged."""
        wanted = [self._nominal_value(name) for name in names]
        known: dict[str, set[str]] = {}
        for column, value in filter(None, wanted):
            known.setdefault(column, set()).add(value)
        values = np.array(
            [
                self.numbers(name) if found is None else self._is_value(*found, known[found[0]])
                for name, found in zip(names, wanted, strict=True)
            ],
            dtype=np.float64,
        ).T
        return FeatureTable(
            names=tuple(names),
            units=tuple(self.units.get(name, "") for name in names),
            values=values.reshape(len(self), len(names)),
        )

    def _nominal_value(self, name: str) -> tuple[str, str] | None:
        """Return the nominal column and the value that a name such as `colour=red` means; None for another name."""
        if name in self.cells:
            return None
        return next((found for found in splits_of(name) if found[0] in self.cells), None)

    def _is_value(self, column: str, value: str, known: set[str]) -> list[float]:
        """Return 1 where a nominal column has this value, NaN where it has none of those that are known."""
        return [float(text == value) if text in known else math.nan for text in self.texts(column)]


def is_missing(cell: str) -> bool:
    """Return whether the text of a cell stands for a missing value."""
    return len(cell) <= 4 and cell.lower() in _MISSING


def _rows(path: Path, text: str) -> tuple[list[str], list[int], list[list[str]]]:
    """Return the header, and the line number and the cells of each row that is not empty. Raises DataDamaged."""
    check_lines(path, text)
    header_line = text.lstrip()[: LINE_CHARACTERS.most].splitlines()[0] if text.strip() else ""
    if not header_line:
        raise DataDamaged(f"{path} is empty: it needs a header line and one line per trial")
    separator = max(",;\t", key=header_line.count)
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    header: list[str] = []
    lines: list[int] = []
    rows: list[list[str]] = []
    most_rows = 0
    try:
        for row in reader:
            if not any(cell.strip() for cell in row):
                continue
            if not header:
                header = [text_of_cell(cell.strip()) for cell in row]
                check_columns(path, header)
                most_rows = CELLS.most // len(header)
                continue
            if len(row) != len(header):
                raise DataDamaged(
                    f"{path}, line {reader.line_num}: {len(row)} values, but the header names {len(header)} columns"
                )
            if len(rows) >= most_rows:
                raise DataDamaged(f"{path}: {CELLS.exceeded((len(rows) + 1) * len(header))}")
            rows.append([text_of_cell(cell.strip()) for cell in row])
            lines.append(reader.line_num)
    except csv.Error as error:
        raise DataDamaged(f"{path}, line {reader.line_num}: {error}") from None
    if not rows:
        raise DataDamaged(f"{path} has a header but no trials: it needs one line per trial")
    return header, lines, rows


def check_lines(path: Path, text: str) -> None:
    """Raise DataDamaged if a line of the text is too long, or if there are too many of them."""
    if too_many := CELLS.exceeded(sum(map(text.count, _LINE_ENDS))):
        raise DataDamaged(f"{path}: {too_many}")
    most = LINE_CHARACTERS.most
    if len(text) <= most:
        return
    start = number = 0
    for number, match in enumerate(re.finditer("\r\n|[\r\n]", text), 1):
        if match.start() - start > most:
            raise DataDamaged(f"{path}, line {number}: {LINE_CHARACTERS.exceeded(match.start() - start)}")
        start = match.end()
    if too_long := LINE_CHARACTERS.exceeded(len(text) - start):
        raise DataDamaged(f"{path}, line {number + 1}: {too_long}")


def check_columns(path: Path, names: Sequence[str]) -> None:
    """Raise DataDamaged if a table has too many columns, or one with a name that is too long."""
    if too_many := COLUMNS.exceeded(len(names)):
        raise DataDamaged(f"{path}: {too_many}")
    for number, name in enumerate(names, 1):
        if len(name) > LONGEST_NAME:
            raise DataDamaged(
                f"{path}: the name of column {number} has {len(name)} characters, and at most {LONGEST_NAME} are "
                f"accepted: {name[:40]!r}..."
            )


def text_of(path: Path) -> str:
    """Return the text of a file in UTF-8. Raises ConfigError if it cannot be read, DataDamaged if it is not text."""
    refuse_devices(path)
    most = TEXT_BYTES.most
    try:
        with path.open("rb") as file:
            data = file.read(most + 1)
            size = len(data) if len(data) <= most else max(path.stat().st_size, len(data))
    except OSError as error:
        raise not_opened(path, error) from error
    except ValueError as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    if too_large := TEXT_BYTES.exceeded(size):
        raise DataDamaged(f"{path}: {too_large}")
    if data.startswith((b"\xff\xfe", b"\xfe\xff")):
        raise DataDamaged(f"{path} is UTF-16: save it as UTF-8")
    if b"\0" in data:
        raise DataDamaged(f"{path} contains zero bytes: it is not a text file")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise DataDamaged(
            f"{path}, line {line}: byte 0x{data[error.start]:02x} is not UTF-8: save the file as UTF-8"
        ) from None


def _is_number(cell: str) -> bool:
    try:
        return math.isfinite(float(cell))
    except ValueError:
        return False
