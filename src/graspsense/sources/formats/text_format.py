"""Text files of recordings as tables of numbers, texts and times.

A column of times, as ISO 8601 or times of the day, is a column of seconds since its first one.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

import numpy as np
from attrs import evolve

from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.label_text import is_missing_label
from graspsense.core.values.limits import CELLS
from graspsense.core.values.written_numbers import (
    NotNumbers,
    columns_of_numbers,
    doubts_of_marks,
    is_missing,
    is_number,
    rows_of_lists,
    truths,
)
from graspsense.core.values.written_times import seconds_since_first
from graspsense.sources.formats.patterns import regular_expression
from graspsense.sources.formats.table import ColumnTable, Numbers
from graspsense.sources.formats.text_table import (
    Line,
    TextTable,
    distinct_names,
    numbers_with_unit,
    read_lines,
    table_of,
)
from graspsense.sources.units import unit_in

_Part = tuple[dict[str, str], Sequence[Line]]

_FACT: Final = re.compile(
    r"""[#%"\s]*(?P<name>[^\W\d][\w .-]*?)"?\s*(?:[:=]\s*"?(?P<said>[^"]+?)|[;,\t]\s*"?(?P<cell>[^;,\t"]+))["\s;,]*"""
)
"""A line before a table that says something: `# date: 2026-05-03`, `Operator;Ada`."""
_LONGEST_FACT: Final = 300
"""Characters of such a line, so that its expression cannot take long."""


def read_text(path: Path, start: str = "") -> list[ColumnTable]:
    """Return the tables in a text file: one, or with `start` one for each line that this regular expression matches.

    The named groups of `start` become fields of the table that begins there; lines before the first match are left out.
    One of several tables that cannot be read has its `damage`. Raises ConfigError if the file cannot be read,
    DataDamaged with the line that does not fit.
    """
    lines, ended = read_lines(path, start)
    parts = list(_parts(lines, start))
    several = len(parts) > 1
    read = [
        _part_table(path, part, ended=ended or k < len(parts), several=several)
        for k, part in enumerate(parts, 1)
    ]
    tables = [table for table in read if table is not None]
    if not tables:
        what = f"no line of it matches start = {start!r}" if start else "it has no line with columns"
        raise DataDamaged(f"{path} has no recording: {what}")
    return tables


def _part_table(path: Path, part: _Part, *, ended: bool, several: bool) -> ColumnTable | None:
    """Return the table of a part; None if it has no line with columns. Raises DataDamaged for the only part."""
    fields, lines = part
    try:
        table = table_of(path, lines, ended=ended)
        if not table.names:
            return None
        about = _said_before(lines, table)
        return evolve(_columns(path, fields, table, several=several), about=about)
    except DataDamaged as error:
        if not several:
            raise
        where = f", line {lines[0][0]}" if lines else ""
        return ColumnTable(source=f"{path.name}{where}", fields=fields, damage=str(error))


def _said_before(lines: Sequence[Line], table: TextTable) -> dict[str, str]:
    """Return what the lines before a table say, by the names that fields can have."""
    begin = table.named_in or min(table.lines, default=0)
    short = [line for number, line in lines if number < begin and len(line) < _LONGEST_FACT]
    facts = [match for line in short if (match := _FACT.fullmatch(line))]
    return {
        re.sub(r"\W+", "_", fact["name"].lower()).strip("_"): (fact["said"] or fact["cell"]).strip()
        for fact in facts
    }


def _parts(lines: Sequence[Line], start: str) -> Iterator[_Part]:
    """Yield the lines of each table, with the facts of the line that begins it."""
    if not start:
        yield {}, lines
        return
    pattern = regular_expression(start)
    begins = [(k, match) for k, (_, line) in enumerate(lines) if (match := pattern.search(line))]
    for (k, match), end in zip(begins, [*(k for k, _ in begins[1:]), len(lines)], strict=True):
        fields = {name: value.strip() for name, value in match.groupdict(default="").items()}
        yield fields, lines[k + 1 : end]


def _columns(path: Path, fields: dict[str, str], table: TextTable, *, several: bool) -> ColumnTable:
    if not table.lines:
        raise DataDamaged(
            f"{path} names its columns in line {table.named_in}, and has no line of numbers after it"
        )
    cells = dict(zip(distinct_names(table.names), table.columns, strict=True))
    numbers: dict[str, Numbers] = {}
    texts: dict[str, Sequence[str]] = {}
    not_numbers: dict[str, str] = {}
    units = {name: unit_in(name) or unit for name, unit in zip(cells, table.units, strict=True)}
    for name in cells:
        plain, units[name] = numbers_with_unit(cells[name], units[name])
        if plain is not cells[name]:
            texts[name], cells[name] = cells[name], plain
    read = columns_of_numbers(cells, decimal_commas=table.separator == ";")
    for name, column in read.items():
        if not isinstance(column, NotNumbers):
            numbers[name] = column
            # As numbers `none` and `NA` are missing, and as labels they are not.
            if np.isnan(column).any() and any(is_missing(c) and not is_missing_label(c) for c in cells[name]):
                texts[name] = cells[name]
            continue
        lists = _lists(path, name, cells[name])
        if lists is not None:
            numbers[name] = lists[:, 0] if lists.shape[1] == 1 else lists
            continue
        texts[name] = cells[name]
        times, logical = seconds_since_first(cells[name]), truths(cells[name])
        if times is not None:
            numbers[name] = times
            units[name] = "s"
        elif logical is not None:
            numbers[name] = logical
        elif column.row or is_number(column.cell):
            not_numbers[name] = f"line {table.lines[column.row]} has {column.words}"
        elif numbers_with_unit([column.cell])[1]:
            not_numbers[name] = (
                f"line {table.lines[column.row]} has {column.cell!r}, and other cells have another unit or none"
            )
    return ColumnTable(
        source=f"{path.name}, line {table.named_in or table.lines[0]}" if several else path.name,
        numbers=numbers,
        texts=texts,
        fields=fields,
        units={name: unit for name, unit in units.items() if unit},
        lines=np.array(table.lines, dtype=np.int64),
        not_numbers=not_numbers,
        notes=table.notes,
        warnings=doubts_of_marks(cells, read, table.separator),
    )


def _lists(path: Path, name: str, cells: Sequence[str]) -> Numbers | None:
    """Return the numbers of a column of lists, None if it is another one. Raises DataDamaged if they are too many."""
    if not cells[0].startswith("["):
        return None
    if too_many := CELLS.exceeded(sum(len(cell.replace(",", " ").split()) for cell in cells)):
        raise DataDamaged(f"{path}: the lists of column {name!r} have {too_many}")
    return rows_of_lists(cells)
