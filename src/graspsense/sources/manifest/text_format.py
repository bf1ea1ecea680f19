"""Text files with columns: CSV as many programs write it.

Columns are separated by semicolons, tabs, commas or spaces. A number has a decimal point or, where commas do not
separate columns, a decimal comma. Lines that begin with `#` or `%` are comments. The first line names the columns; if
it has numbers only, they are called c1, c2 and so on. A first column without a name, which pandas writes, is `index`.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from attrs import define, field

from graspsense.core.files.limits import CELLS
from graspsense.core.values.errors import DataDamaged
from graspsense.sources.csv_columns import check_columns, check_lines, is_missing, text_of
from graspsense.sources.manifest.patterns import regular_expression
from graspsense.sources.manifest.table import ColumnTable, Numbers

COMMENTS: Final = ("#", "%")
_DECIMAL_COMMA: Final = re.compile(r"[-+]?\d*,\d+(?:[eE][-+]?\d+)?")
_NUMBER: Final = re.compile(
    r"[-+]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][-+]?\d+)?|[-+]?(?:nan|inf|infinity)", re.IGNORECASE
)


@define
class _Part:
    """Consecutive lines that make up one table, with the facts of the line that begins them."""

    fields: dict[str, str]
    lines: list[tuple[int, str]] = field(factory=list)


def read_text(path: Path, start: str = "") -> list[ColumnTable]:
    """Return the tables in a text file: one, or with `start` one for each line that this regular expression matches.

    The named groups of `start` become fields of the table that begins there; lines before the first match are left out.
    Raises ConfigError if the file cannot be read, DataDamaged with the line that does not fit.
    """
    text = text_of(path)
    check_lines(path, text)
    parts = [part for part in _parts(text, start) if part.lines]
    if not parts:
        what = f"no line of it matches start = {start!r}" if start else "it has no line with columns"
        raise DataDamaged(f"{path} has no recording: {what}")
    several = len(parts) > 1
    return [_table(path, part, f"line {part.lines[0][0]}" if several else "") for part in parts]


def _parts(text: str, start: str) -> Iterator[_Part]:
    begins = regular_expression(start) if start else None
    part = None if begins else _Part({})
    for number, line in enumerate(text.splitlines(), 1):
        match = begins.search(line) if begins else None
        if match:
            if part is not None:
                yield part
            part = _Part({name: value.strip() for name, value in match.groupdict(default="").items()})
        elif part is not None and line.strip() and not line.lstrip().startswith(COMMENTS):
            part.lines.append((number, line))
    if part is not None:
        yield part


def _table(path: Path, part: _Part, where: str) -> ColumnTable:
    separator = _separator([line for _, line in part.lines[:20]])
    rows = _rows(path, part, separator)
    numbers = [number for number, _ in part.lines]
    if all(_is_number(cell) or is_missing(cell) for cell in rows[0]):
        names = [f"c{k}" for k in range(1, len(rows[0]) + 1)]
    else:
        names = _names(rows.pop(0))
        numbers.pop(0)
    if not rows:
        raise DataDamaged(
            f"{path} names its columns in line {part.lines[0][0]}, and has no line of numbers after it"
        )
    for number, row in zip(numbers, rows, strict=True):
        if len(row) != len(names):
            raise DataDamaged(f"{path}, line {number}: {len(row)} values, but there are {len(names)} columns")
    commas = separator != "," and any(_DECIMAL_COMMA.fullmatch(cell) for row in rows[:50] for cell in row)
    found: dict[str, Numbers] = {}
    texts: dict[str, Sequence[str]] = {}
    not_numbers: dict[str, str] = {}
    for name, cells in zip(names, zip(*rows, strict=True), strict=True):
        values = _numbers([cell.replace(",", ".") for cell in cells] if commas else cells)
        if values is None:
            texts[name] = cells
            if _is_number(cells[0]):
                k = next(k for k, cell in enumerate(cells) if not (_is_number(cell) or is_missing(cell)))
                not_numbers[name] = f"line {numbers[k]} has {cells[k][:40]!r}"
        else:
            found[name] = values
    return ColumnTable(
        source=f"{path.name}, {where}" if where else path.name,
        numbers=found,
        texts=texts,
        fields=part.fields,
        lines=np.array(numbers, dtype=np.int64),
        not_numbers=not_numbers,
    )


def _rows(path: Path, part: _Part, separator: str) -> list[list[str]]:
    """Return the cells of each line. Raises DataDamaged for too many of them."""
    first = _cells(path, *part.lines[0], separator)
    check_columns(path, first)
    if too_many := CELLS.exceeded(len(part.lines) * len(first)):
        raise DataDamaged(f"{path}: {too_many}")
    return [first, *(_cells(path, number, line, separator) for number, line in part.lines[1:])]


def _separator(lines: Sequence[str]) -> str:
    """Return the separator of these lines: a semicolon, a tab, a comma, or a space for any number of spaces."""
    for separator in ";\t":
        if any(separator in line for line in lines):
            return separator
    commas = [line for line in lines if "," in line]
    if not commas:
        return " "
    # `1,5 2,5`: the commas are within numbers, and spaces separate.
    words = [word for line in commas for word in line.split()]
    spaced = all(len(line.split()) > 1 for line in commas)
    return (
        " " if spaced and all(_DECIMAL_COMMA.fullmatch(word) or _is_number(word) for word in words) else ","
    )


def _cells(path: Path, number: int, line: str, separator: str) -> list[str]:
    if separator == " ":
        return line.split()
    try:
        (row,) = csv.reader([line], delimiter=separator, strict=True)
    except (csv.Error, ValueError) as error:
        raise DataDamaged(f"{path}, line {number}: {error}") from None
    return [cell.strip() for cell in row]


def _names(cells: Sequence[str]) -> list[str]:
    """Return a name for each column: a second one of the same name gets `.1` behind it, as pandas writes it."""
    names: dict[str, None] = {}
    repeats: dict[str, int] = {}
    for k, cell in enumerate(cells):
        name = cell or ("index" if k == 0 else f"c{k + 1}")
        again = repeats.get(name, 0)
        while (name if not again else f"{name}.{again}") in names:
            again += 1
        repeats[name] = again
        names[f"{name}.{again}" if again else name] = None
    return list(names)


def _numbers(cells: Sequence[str]) -> Numbers | None:
    """Return the cells as numbers, None if one of them is another text."""
    try:
        return np.array([float("nan") if is_missing(one) else float(one) for one in cells], dtype=np.float64)
    except ValueError:
        return None


def _is_number(cell: str) -> bool:
    return _NUMBER.fullmatch(cell) is not None
