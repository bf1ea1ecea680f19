"""Text files as tables: where the table begins, what separates its columns, how they are called, and its cells.

A table may be preceded by lines about the instrument, by `sep=;`, or by comments (`#`, `%`, `//`, `!`), and its names
may be followed by a line with units. Its names can stand in a comment, as `numpy.savetxt` writes them. A file with one
JSON object a line is a table too. Whatever is left out is told in a note.
"""

from __future__ import annotations

import csv
import json
import math
import re
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Sequence
from itertools import chain, compress, pairwise, takewhile
from operator import itemgetter, lt
from pathlib import Path
from typing import Any, Final, NamedTuple

from attrs import frozen

from graspsense.core.values.errors import DataDamaged, counted, listed
from graspsense.core.values.limits import CELLS, COLUMNS, LINE_CHARACTERS
from graspsense.core.values.written_numbers import (
    NotNumbers,
    columns_of_numbers,
    is_missing,
    is_number,
    plain_text,
)
from graspsense.core.values.written_times import seconds_since_first
from graspsense.sources.formats.file_text import text_of
from graspsense.sources.units import UNITS

LONGEST_NAME: Final = 500
"""Limit on the characters of the name of a column."""
JSON_LINES: Final = (".jsonl", ".ndjson")
"""Endings of files with one JSON object a line."""
GZIP: Final = ".gz"
INDEX: Final = "index"
"""Name of a first column without a name."""
_SINGLE_UNITS: Final = frozenset("smgNJWVACK%\u00b0")
"""Units of one sign behind a number: in the other case, or as `12-`, it can be a factor or a sign of its own."""
_SPACES: Final = ("  ", " ")
"""Two spaces or more, where names have spaces, and any number of them."""
_SEPARATORS: Final = (";", "\t", ",", "|", *_SPACES)
_COMMENTS: Final = ("#", "%", "//", "!")
_RULE: Final = re.compile(r"(?=.*(?:[-_=]{3}|:-|-:))[-_=+|:\s]+")
"""A line of signs below the names, or around a table."""
_REMARKS: Final = frozenset({"comment", "comments", "remark", "remarks", "note", "notes"})
"""Names of a last column that can be without any cell."""
_KIND: Final = re.compile(
    "<?(?:continuous|c|discrete|d|string|str|s|(?:var)?char|text|object|time|t|u?int(?:eger)?|float|double|real"
    "|num(?:ber|eric)?|dbl)(?:8|16|32|64)?>?"
)
"""The kind of a column in a line below the names, as Orange and other programs write it, in small letters."""
_SEPARATOR_LINE: Final = re.compile(r'"?sep=([;,\t|])"?\s*')
_APOSTROPHES: Final = re.compile(r"[;,\t|]? *'[^']*' *(?:[;,\t|] *'[^']*' *)+[;,\t|]?")
"""Names in apostrophes in place of quotes."""
_APOSTROPHE: Final = re.compile(r"(?<![^;,\t|])'|'(?![^;,\t|])")
_QUOTED_NUMBER: Final = re.compile(r'"\d+"[;,\t| ](?:.*[;,\t| ])?[-+.\d]')
"""A number in quotes, as R writes the name of a row, before one without them."""
_REMARK: Final = re.compile(r"\s(?:#|%|//|!)\s*[^\s\d]")
"""The beginning of a comment behind cells."""
_SHOWN_AS_IT_IS: Final = re.compile('="(.*)"')
"""A cell that a spreadsheet shall show as it is: ="0.5"."""
_WITH_UNIT: Final = re.compile(r"(.*[0-9.])\s*([^\s0-9]+)")
_SAMPLED: Final = 400
"""Lines from which the separator and the kinds of the columns are found."""
_SAMPLED_SIZE: Final = 100_000
"""Cells of these lines."""
_FEW_BEFORE: Final = 4
_MOST_BEFORE: Final = 0.1
"""Lines of numbers before the names, and their share of those after them, beyond which they can be data."""
_MOST_JSON_PARTS: Final = 8
"""Depth of lists and objects in a JSON line."""

Line = tuple[int, str]
Row = tuple[int, list[str]]


@frozen(kw_only=True, eq=False)
class TextTable:
    """The cells of a table as text. A column without a name has an empty one; `units` are those of a line of units."""

    names: tuple[str, ...] = ()
    units: tuple[str, ...] = ()
    columns: tuple[Sequence[str], ...] = ()
    lines: tuple[int, ...] = ()
    """The line of each row."""
    notes: tuple[str, ...] = ()
    named_in: int = 0
    """The line with the names, 0 if there is none."""
    separator: str = ""


class _Header(NamedTuple):
    """The names in a line (0: none), units if any, the first row behind, and the row beside with units or kinds."""

    names: list[str]
    units: list[str] | None
    begin: int
    line: int
    beside: list[str] | None = None


def read_lines(path: Path, start: str = "") -> tuple[list[Line], bool]:
    """Return the lines of a text file with their numbers, and whether the last one ends as the others do.

    A spreadsheet is a text with tabs; with `start`, as `read_text` has it, it may have several sheets. Raises
    PluginUnavailable, ConfigError, TooLarge, DataDamaged.
    """
    text = text_of(path, start)
    if too_many := CELLS.exceeded(text.count("\n") + text.count("\r")):
        raise DataDamaged(f"{path}: {too_many}")
    lines = list(enumerate(re.split("\r\n|[\r\n]", text), 1))
    number, longest = max(lines, key=lambda line: len(line[1]))
    if too_long := LINE_CHARACTERS.exceeded(len(longest)):
        raise DataDamaged(f"{path}, line {number}: {too_long}")
    return lines, not text or text.endswith(("\n", "\r"))


def table_of(path: Path, lines: Sequence[Line], *, ended: bool = True) -> TextTable:
    """Return the table in these lines of a file, which may have no rows; `ended`: the last line is known to be whole.

    Raises DataDamaged with the line that does not fit.
    """
    top_line = next((line.strip() for _, line in lines if line.strip()), "")
    if text_suffix(path) in JSON_LINES or (top_line.startswith('{"') and top_line.endswith("}")):
        return _json_table(path, lines, ended)
    return _Layout(path, lines, ended).table()


def text_suffix(path: Path) -> str:
    """Return the ending of a name in small letters, without that of a compression."""
    return Path(path.name.lower().removesuffix(GZIP)).suffix


class _Layout:
    """How the lines of a file are laid out."""

    def __init__(self, path: Path, lines: Sequence[Line], ended: bool) -> None:
        self.path, self.ended = path, ended
        self.notes: list[str] = []
        written = [(number, line) for number, line in lines if line.strip()]
        given = _SEPARATOR_LINE.fullmatch(written[0][1]) if written else None
        if given:
            written = written[1:]
        self.comments, plain = _comments_and_others(written)
        if all(re.fullmatch(r"\s*\|.*\|\s*", line) for _, line in plain):
            plain = [(number, line.strip()[1:-1]) for number, line in plain]
        if any(_APOSTROPHES.fullmatch(line) for _, line in plain[:_FEW_BEFORE]):
            plain = [(number, _APOSTROPHE.sub('"', line)) for number, line in plain]
        self.separator = given[1] if given else _separator([line for _, line in _sample(plain)])
        plain = self._without_remarks(plain)
        self.numbered = {number for number, line in plain if _QUOTED_NUMBER.match(line)}
        self.blank: list[int] = []
        self.rows = _with_remarks(self._rows(plain))

    def table(self) -> TextTable:
        """Return the table. Raises DataDamaged."""
        if not self.rows:
            return TextTable()
        names, units, begin, line, beside = self._header()
        check_columns(self.path, names)
        rows = self._without_repeats(self.rows[begin:], names, beside)
        rows = self._without_texts(rows, len(names))
        rows = [(number, row if any(row[len(names) :]) else row[: len(names)]) for number, row in rows]
        named = names[: -1 if line in self.separated else None]
        if names[0] and _begin_with_names(rows if self.ended else rows[:-1], len(named) + 1, self.numbered):
            names, units = ["", *named], ["", *units] if units else None
        rows = self._without_cut(rows, len(names))
        for number, row in rows:
            if len(row) != len(names):
                raise DataDamaged(
                    f"{self.path}, line {number}: {len(row)} values, but there are {len(names)} columns"
                )
        self._tell((number for number, _ in self.comments if rows and number > rows[0][0]), "comment")
        between = (number for number in self.blank if rows and rows[0][0] < number < rows[-1][0])
        self._tell(between, "line of empty cells")
        return TextTable(
            names=tuple(" ".join(name.split()) for name in names),  # in quotes, one can have several lines
            units=tuple(unit.strip("[]()") for unit in (units or [""] * len(names))[: len(names)]),
            columns=tuple(zip(*(row for _, row in rows), strict=True)) if rows else ((),) * len(names),
            lines=tuple(number for number, _ in rows),
            notes=tuple(self.notes),
            named_in=line,
            separator=self.separator,
        )

    def _without_remarks(self, lines: list[Line]) -> list[Line]:
        """Return the lines without the comments that some have behind their cells."""
        begins = {number: match.start() for number, line in lines if (match := _REMARK.search(line))}
        width, _ = _width([line for _, line in _sample(lines)], self.separator)
        ends = {
            line.rpartition(self.separator)[2].strip(' "') for number, line in lines if number not in begins
        }
        shorter: dict[int, str] = {}
        for number, line in lines if 2 * len(begins) < len(lines) else ():
            text = line[: begins.get(number, 0)].rstrip(f"{self.separator} ")
            cells = _split(text, self.separator)
            if len(cells) == width and (is_number(cells[-1]) or cells[-1] in ends):
                shorter[number] = text
        self._tell(shorter, "line with a comment behind its cells")
        return [(number, shorter.get(number, line)) for number, line in lines] if shorter else lines

    def _rows(self, lines: Sequence[Line]) -> list[Row]:
        """Return the cells of each line that is not empty, without the last columns that none has.

        A cell in quotes may go over several lines; a row has the number of its last one. Separators at the end of lines
        make empty columns. Raises DataDamaged, also for too many cells.
        """
        kept, count, line, most, widest = [], 0, 0, CELLS.most, COLUMNS.most
        shown_as_it_is = any('="' in text for _, text in lines)
        reader = _reader([text + "\n" for _, text in lines], self.separator)
        rows = reader if reader else (_split(text, self.separator) for _, text in lines)
        try:
            for k, row in enumerate(rows, 1):
                line = lines[(reader.line_num if reader else k) - 1][0]
                cells = [*map(str.strip, row)]
                if not any(cells):
                    self.blank.append(line)
                    continue
                if shown_as_it_is:
                    cells = [_SHOWN_AS_IT_IS.sub(r"\1", cell) for cell in cells]
                count += len(cells)
                if len(cells) > widest or count > most:
                    too_many = COLUMNS.exceeded(len(cells)) or CELLS.exceeded(count)
                    raise DataDamaged(f"{self.path}, line {line}: {too_many}")
                kept.append((line, cells))
        except (csv.Error, ValueError) as error:
            line = lines[max(0, min(reader.line_num, len(lines)) - 1)][0]
            raise DataDamaged(f"{self.path}, line {line}: {error}") from None
        used = longest = max((len(row) for _, row in kept), default=0)
        while used and not any(any(row[used - 1 :]) for _, row in kept):
            used -= 1
        self.separated = {number for number, row in kept if len(row) == used == longest - 1 and not row[-1]}
        return [(number, row[:used]) for number, row in kept]

    def _header(self) -> _Header:
        """Return where the names are. Raises DataDamaged if none of several lines before the numbers has them."""
        sample = _sample([row for _, row in self.rows])
        width = max(Counter(map(len, sample)).items(), key=lambda item: (item[1], item[0]))[0]
        line, top = self.rows[0]
        if len(top) == 1 < width and len(divided := self._cells(top[0], width)) == width:
            self.rows[0] = (line, top := divided)
        numeric = _numeric_columns(sample[: max(2, _SAMPLED_SIZE // width)], width)
        data = next((k for k, (_, row) in enumerate(self.rows) if _is_data(row, width, numeric)), None)
        if data is None:
            return _Header(top, None, 1, line)
        data = self._behind_second_names(data, width, numeric)
        above = self._names_in_comments(width, self.rows[data][0])
        plain, self.rows = self.rows, sorted([*self.rows, *above])
        begin = data + len(above)
        if header := self._joined_names(begin, width) or self._names_in_row(begin, width, numeric):
            return header
        self.rows = plain
        likely = len(top) > max(1, width - 2) if data else not self._is_as_below(top, numeric)
        if data < 2 and likely and not _are_numbers(top):
            return _Header(top, None, 1, line)
        return self._without_names(data, width)

    def _is_as_below(self, top: Sequence[str], numeric: frozenset[int]) -> bool:
        """Return whether a cell of the first row is no name: a text that its column has below, or a time."""
        texts = {(k, cell) for _, row in self.rows[1:] if row != top for k, cell in enumerate(row)}
        cells = [(k, cell) for k, cell in enumerate(top) if k not in numeric and cell]
        return any(item in texts or seconds_since_first([item[1]]) is not None for item in cells)

    def _behind_second_names(self, data: int, width: int, numeric: frozenset[int]) -> int:
        """Return the row behind the last names that a few rows of numbers precede, as those of a summary, or `data`."""
        most = data + max(_FEW_BEFORE, int(_MOST_BEFORE * len(self.rows)))
        named = [
            k
            for k, ((_, row), (_, following)) in enumerate(pairwise(self.rows[data + 1 : most + 2]), data + 1)
            if len(row) > 1
            and not any(is_number(row[c]) or is_missing(row[c]) for c in numeric if c < len(row))
            and _can_be_names(row, width, [set()] * width)
            and all(row != earlier for _, earlier in self.rows[:data])
            and _is_data(following, width, numeric)
        ]
        return named[-1] + 1 if named else data

    def _names_in_row(self, data: int, width: int, numeric: frozenset[int]) -> _Header | None:
        """Return the names in one of the rows before the numbers, None if none has names. Raises DataDamaged.

        Units, or the kinds of the columns, come behind the names, and remarks on the columns may come behind these.
        """
        head = [row for _, row in self.rows[:data]]
        below = [row for _, row in self.rows[data:] if row not in head]
        texts = [set() if k in numeric else {row[k] for row in below if k < len(row)} for k in range(width)]
        able = [k for k in range(data) if _can_be_names(head[k], width, texts)]
        above_units = [
            k
            for k in able
            if k + 1 < data
            and len(head[k]) <= len(head[k + 1])
            and (_are_units(head[k + 1]) or _are_kinds(head[k + 1], followed=k + 2 < data))
            and not _are_units(head[k])
            and not any(map(is_number, chain(*head[k + 2 :])))
        ]
        if not able:
            return None
        names = (above_units or able)[-1]
        line, row = self.rows[names]
        near = head[names + 1] if above_units else head[names - 1] if names else []
        beside = near if above_units or (len(near) == width and _are_units(near)) else None
        kinds = beside is not None and _are_kinds(beside, followed=names + 2 < data)
        plain = {number for number, _ in self.rows[:names]} - {number for number, _ in self.comments}
        if skipped := [number for number, row in self.rows[:names] if number in plain and row is not beside]:
            numbers = [number for number, row in self.rows[:names] if len(row) > 1 and _are_numbers(row)]
            if len(numbers) > max(_FEW_BEFORE, _MOST_BEFORE * (len(self.rows) - names)):
                raise DataDamaged(
                    f"{self.path}: line {line} names the columns of the lines after it, and {len(numbers)} lines of "
                    f"numbers come before it, from line {numbers[0]} on: are these two tables? Divide the file, or say "
                    'in a manifest which line begins each grasp: start = "a text in that line"'
                )
            self.notes.append(f"the names of the columns are those of line {line}")
            self._tell(skipped, "line before them")
        again = (number for number, row in self.rows if kinds and row == beside)
        self._tell(again, "line on the kinds of columns")
        return _Header(
            row, None if kinds else beside, data if above_units else names + 1, line, beside=beside
        )

    def _without_names(self, data: int, width: int) -> _Header:
        """Return names for numbers without any. Raises DataDamaged if lines before them may have names."""
        line, top = self.rows[data]
        ordinals = [*map(str, range(width))]
        if data == 0 and width > 2 and top in (ordinals, ["", *ordinals[:-1]]):
            data = 1
        if (data == 1 and _are_numbers(self.rows[0][1])) or all(len(row) == 1 for _, row in self.rows[:data]):
            self._tell([number for number, _ in self.rows[:data]], "line before the numbers without names")
        else:
            raise DataDamaged(
                f"{self.path}: the numbers begin in line {line} with {len(top)} values, and no line before it names "
                f"{width} columns. If line {self.rows[data - 1][0]} is to be left out and the names stand in the next "
                'line, say so in a manifest: start = "a text in that line"'
            )
        return _Header([f"c{k}" for k in range(1, width + 1)], None, data, 0)

    def _joined_names(self, data: int, width: int) -> _Header | None:
        """Return the names that several lines before the numbers have together, None if the last of them has all.

        pandas writes each level of its names in a line, and a spreadsheet a merged cell once, with blanks behind it.
        """
        above = [row for row in self.rows[:data] if len(row[1]) == width]
        written = [row for row in above if sum(map(bool, row[1])) > 1 or (row[1][0] and row is above[-1])]
        units = written.pop()[1] if written and _are_units(written[-1][1]) else None
        levels = [list(row) for _, row in written]
        has_first = any(row[0] for row in levels)
        named = any(_names_all(row) and (row[0] or not has_first) for row in levels)
        named &= len(levels) < 3 or any(levels[-1][1:])  # else pandas names the index below its levels
        named |= any(_are_kinds(row, followed=True) for row in levels)
        if len(levels) < 2 or named or any(map(is_number, chain(*levels))):
            return None
        *upper, lowest = levels
        given = [cell for cell in lowest if cell]
        repeats = len(set(given)) < len(given)
        for row in upper:
            for k, below in enumerate(lowest):
                if below:
                    row[k] = (row[k] or row[max(k - 1, 0)]) if repeats else ""
        names = ["_".join(filter(None, parts)) for parts in zip(*upper, lowest, strict=True)]
        if names == lowest or not _names_all(names):
            return None
        lines = [number for number, _ in written]
        self.notes.append(
            f"the names of the columns are those of the lines {listed([*map(str, lines)])}, joined by _"
        )
        return _Header(names, units, data, lines[-1])

    def _names_in_comments(self, width: int, begin: int) -> list[Row]:
        """Return the comments before this line that have a name, or a unit, for each column."""
        above = [(number, self._cells(line, width)) for number, line in self.comments if number < begin]
        if self.separator == " ":  # as many words as columns can be a remark
            above = above[-2:] if above and _are_units(above[-1][1]) else above[-1:]
        able = [len(cells) == width and (_names_all(cells) or _are_units(cells)) for _, cells in above]
        return list(compress(above, able))

    def _cells(self, comment: str, width: int) -> list[str]:
        """Return the names in a text, which may separate so many words by another sign than the rows do."""
        text = comment.lstrip("#%/! \t").rstrip(";,|\t ")
        for separator in _SEPARATORS if self.separator in _SPACES else _SEPARATORS[: -len(_SPACES)]:
            cells = _split(text, separator)
            whole = separator == self.separator or not any(" " in cell for cell in cells)
            if whole and len(cells) == width:
                return cells
        return _split(text, self.separator)

    def _tell(self, numbers: Iterable[int], what: str) -> None:
        """Note that these lines are left out, if there are any."""
        lines = sorted(numbers)
        some = ", ".join(map(str, lines[:4])) + (", ..." if len(lines) > 4 else "")
        several = what.replace("line ", "lines ", 1) if what.startswith("line ") else f"{what}s"
        self.notes += [f"left out: {counted(len(lines), what, several)} (line {some})"] if lines else []

    def _without_repeats(
        self, rows: list[Row], names: Sequence[str], beside: Sequence[str] | None
    ) -> list[Row]:
        """Return the rows that are not the header again, nor the row beside it."""
        folded = [name.casefold() for name in names]
        again = {number for number, row in rows if [cell.casefold() for cell in row] == folded}
        if not again or all(map(is_number, names)):
            return rows
        self._tell(again, "repeated header")
        return [row for row in rows if row[0] not in again and row[1] != beside]

    def _without_texts(self, rows: list[Row], width: int) -> list[Row]:
        """Return the rows without lines of text, as a device prints one between its numbers, or several behind them.

        Those have words in place of a time, or of a number where they stand apart, or several in place of numbers.
        """
        sample = _sample([row for _, row in rows])
        numeric = _numeric_columns(sample, width)
        times = columns_of_numbers({"": [row[0] for row in sample if is_number(row[0])]})[""]
        # As times and the numbers of rows do; labels and features do not.
        rises = (
            not isinstance(times, NotNumbers) and len(times) > _FEW_BEFORE and all(map(lt, times, times[1:]))
        )
        apart = max((line for (above, _), (line, _) in pairwise(rows) if line > above + 1), default=math.inf)

        def is_text(line: Row) -> bool:
            number, row = line
            there = [row[k] for k in numeric if k < len(row) and not is_missing(row[k])]
            words = 0 in numeric and (rises or number >= apart)
            words = words and not (is_missing(row[0]) or re.search(r"\d", row[0]))
            return words or (len(row) == width and len(there) > 1 and not any(map(is_number, there)))

        texts = {number for number, row in rows if len(row) < width and not any(map(is_number, row))}
        texts |= {number for number, _ in takewhile(is_text, reversed(rows))}
        if not 0 < len(texts) <= max(_FEW_BEFORE, _MOST_BEFORE * len(rows)):
            return rows
        self._tell(texts, "line of text")
        return [row for row in rows if row[0] not in texts]

    def _without_cut(self, rows: list[Row], width: int) -> list[Row]:
        """Return the rows without a last one that was cut off while it was written."""
        if self.ended or len(rows) < 4:
            return rows
        number, last = rows[-1]
        ends = [row[-1] for _, row in rows[:-1] if len(row) == width]
        others = set(map(_decimals, ends))
        shorter = len(others) == 1 and -1 < _decimals(last[-1]) < max(others)
        # An empty last cell may be a missing value, as in other rows.
        if len(last) == width and (last[-1] or not all(ends)) and not shorter:
            return rows
        self.notes.append(f"line {number} is cut off, and left out")
        return rows[:-1]


def _comments_and_others(lines: Sequence[Line]) -> tuple[list[Line], list[Line]]:
    """Return the comments, and the other lines without rules. Behind names, trials can be called #1, #2, and so on."""
    marked = [
        line.lstrip().startswith(_COMMENTS)
        and not is_missing(re.split("[;,\t| ]", line.lstrip(), maxsplit=1)[0])
        for _, line in lines
    ]
    begin = marked.index(False) if False in marked else len(lines)
    if 2 * sum(marked[begin:]) > len(lines) - begin:
        marked[begin:] = [False] * (len(lines) - begin)
    others = [line for line, is_comment in zip(lines, marked, strict=True) if not is_comment]
    return list(compress(lines, marked)), [line for line in others if not _RULE.fullmatch(line[1])]


def _with_remarks(rows: list[Row]) -> list[Row]:
    """Return the rows with the last cell, if most of them lack it, with the separator, as they have no remark.

    The last column then has a name, and texts in some rows, or none if its name says that they are remarks.
    """
    width = 1 + max(Counter(len(row) for _, row in rows).items(), key=itemgetter(1), default=(0, 0))[0]
    wide = [row for _, row in rows if len(row) == width > 2 and row[-1]]
    names = [row for row in wide if all(row) and not any(map(is_number, row))]
    noted = not any(is_number(row[-1]) for row in wide) and any(any(map(is_number, row)) for row in wide)
    if not names or not (noted or names[-1][-1].lower() in _REMARKS):
        return rows
    return [(number, [*row, ""] if len(row) == width - 1 else row) for number, row in rows]


def _begin_with_names(rows: Sequence[Row], width: int, in_quotes: Container[int]) -> bool:
    """Return whether all rows have so many cells, and number or name themselves in the first, as those of R do.

    Numbers that R has sorted are in another order; from the last to the first, or of a part of the rows, they can be
    measured, unless they alone are `in_quotes`.
    """
    names, count = [row[0] for _, row in rows if len(row) == width], len(rows)
    if len(set(names)) < max(count, 2):
        return False
    if not any(map(is_number, names)):
        return count > _FEW_BEFORE
    counted = {*names} in ({*map(str, range(count))}, {*map(str, range(1, count + 1))})
    return (counted and names != sorted(names, key=int, reverse=True)) or all(n in in_quotes for n, _ in rows)


def numbers_with_unit(cells: Sequence[str], of_column: str = "") -> tuple[Sequence[str], str]:
    """Return the numbers and the unit of cells such as `12.3 N`, if all have the same, and that of the column if known.

    Else they are the cells, and the unit of the column.

    >>> numbers_with_unit(["12.3 N", "", "4N"]), numbers_with_unit(["12 mm", "1 m"]), numbers_with_unit(["1 m"], "mm")
    ((['12.3', '', '4'], 'N'), (['12 mm', '1 m'], ''), (['1 m'], 'mm'))
    """
    numbers, unit = [], ""
    for cell in cells:
        match = None if is_missing(cell) else _WITH_UNIT.fullmatch(cell)
        if match and match[2] == (unit or of_column or match[2]) and is_number(match[1]):
            unit = match[2]
        elif not is_missing(cell):
            return cells, of_column
        numbers.append(match[1] if match else cell)
    known = unit.lower() in UNITS if len(unit) > 1 else unit in _SINGLE_UNITS
    return (numbers, unit) if known else (cells, of_column)


def _json_table(path: Path, lines: Sequence[Line], ended: bool) -> TextTable:
    """Return the table of a file with one JSON object a line. Raises DataDamaged."""
    written = [(number, line) for number, line in lines if line.strip()]
    rows: list[dict[str, str]] = []
    names: dict[str, None] = {}
    notes: list[str] = []
    for k, (number, line) in enumerate(written):
        try:
            value = json.loads(line, parse_float=str, parse_int=str, object_pairs_hook=tuple)
            if not isinstance(value, tuple):
                raise DataDamaged(f"{path}, line {number}: not a JSON object in braces")
            cells = list(_cells_of(value, "", 0))
            row = dict(cells)
            if len(row) < len(cells):
                raise ValueError("it names a value twice")
        except (ValueError, RecursionError) as error:
            if k and k == len(written) - 1 and not ended:
                notes.append(f"line {number} is cut off, and left out")
                break
            raise DataDamaged(f"{path}, line {number}: not a JSON object: {error}") from None
        names |= dict.fromkeys(row)
        rows.append(row)
        if too_many := COLUMNS.exceeded(len(names)) or CELLS.exceeded(len(rows) * len(names)):
            raise DataDamaged(f"{path}: {too_many}")
    check_columns(path, list(names))
    return TextTable(
        names=tuple(names),
        units=("",) * len(names),
        columns=tuple([row.get(name, "") for row in rows] for name in names),
        lines=tuple(number for number, _ in written[: len(rows)]),
        notes=tuple(notes),
        named_in=written[0][0] if written else 0,
    )


def _cells_of(value: Any, name: str, depth: int) -> Iterator[tuple[str, str]]:
    """Yield the name and the text of each value in a JSON value: `pads.left`, `taxels.0`. An object is its pairs."""
    if depth > _MOST_JSON_PARTS:
        raise ValueError(f"it is nested deeper than {_MOST_JSON_PARTS}")
    if isinstance(value, list):
        value = tuple(enumerate(value))
    if isinstance(value, tuple):
        for key, part in value:
            yield from _cells_of(part, f"{name}.{key}" if name else str(key), depth + 1)
    else:
        text = str(int(value)) if isinstance(value, bool) else str(value).strip()
        yield name, "" if value is None else text


def _sample(lines: Sequence[Any]) -> list[Any]:
    """Return lines from the beginning, and from everywhere."""
    half = _SAMPLED // 2
    return [*lines[:half], *lines[half :: max(1, (len(lines) - half) // half)]]


def _separator(lines: Sequence[str]) -> str:
    """Return what separates the cells of these lines: a semicolon, a tab, a comma, a bar, or any number of spaces.

    It gives most lines, and so their names, the same number of cells. In a single column it is a sign that no text has:
    the name may have spaces.
    """
    widths = {separator: _width(lines, separator) for separator in _SEPARATORS}
    agreeing = {separator: count for separator, (width, count) in widths.items() if width > 1}
    if all("\t" not in re.sub("[;,]\t", "", line) for line in lines):
        agreeing.pop("\t", None)  # each is behind the sign that separates
    signs = {separator: count for separator, count in agreeing.items() if separator.strip(" ")}
    between = (2 * sum(map(is_number, words)) > len(words) for words in (_split(line, " ") for line in lines))
    tabs = ("\t" in line and _are_numbers(line.split("\t")) for line in lines)
    if signs and (2 * sum(between) < len(lines) or 2 * sum(tabs) >= len(lines)):
        agreeing = signs
    elif agreeing.get(" ", 0) >= agreeing.get(",", 1):
        agreeing.pop(",", None)  # it is within numbers, as in `1,5 2,5`
    return max(agreeing, key=lambda separator: agreeing[separator], default="\x1f")


def _reader(lines: Iterable[str], separator: str) -> Any:
    """Return the reader of lines that a sign separates, None for spaces."""
    if separator in _SPACES:
        return None
    return csv.reader(lines, delimiter=separator, skipinitialspace=True, strict=True)


def _split(line: str, separator: str) -> list[str]:
    """Return the cells of a line; none if it cannot be divided. Spaces within quotes are of their word."""
    if separator == "  ":
        return [word.strip('"') for word in re.split(r"\s{2,}", line.strip())]
    if separator == " ":
        return [quoted or word for quoted, word in re.findall(r'"([^"]*)"(?!\S)|(\S+)', line)]
    try:
        return [*map(str.strip, next(_reader([line], separator), []))]
    except (csv.Error, ValueError):
        return []


def _are_numbers(cells: Sequence[str]) -> bool:
    """Return whether every cell is a number or missing."""
    return all(is_number(cell) or is_missing(cell) for cell in cells)


def _width(lines: Sequence[str], separator: str) -> tuple[int, int]:
    """Return the most frequent number of cells of a line, without separators at its end, and how many lines have it."""
    short = [line.rstrip(separator) for line in lines]
    widths = Counter(
        len(_split(text if separator in text else line, separator))
        for text, line in zip(short, lines, strict=True)
    )
    return max(widths.items(), key=itemgetter(1), default=(1, 0))


def _numeric_columns(rows: Sequence[Sequence[str]], width: int) -> frozenset[int]:
    """Return which columns have numbers in most rows of this width."""
    columns = zip(*(row for row in rows if len(row) == width), strict=True)
    known = {k: [cell for cell in cells if not is_missing(cell)] for k, cells in enumerate(columns)}
    return frozenset(k for k, cells in known.items() if 2 * sum(map(is_number, cells)) >= len(cells) > 0)


def _is_data(row: Sequence[str], width: int, numeric: frozenset[int]) -> bool:
    """Return whether a row has a number where numbers are expected, and nothing else there."""
    there = [row[k] for k in numeric if k < len(row) and not is_missing(row[k])]
    return len(row) == width and bool(there) and all(map(is_number, there))


def _can_be_names(row: Sequence[str], width: int, texts: Sequence[set[str]]) -> bool:
    """Return whether a row can name so many columns: different texts, and none that a column of text has below."""
    named = [cell for cell in row if cell]
    return (
        width - 1 <= len(row) <= width
        and len(named) >= max(len(row) - 1, 1)
        and not any(is_number(cell) or (is_missing(cell) and plain_text(cell).strip("-.?")) for cell in named)
        and (2 * len(set(named)) > len(named) or _are_units(row))
        and not any(cell in texts[k] for k, cell in enumerate(row) if cell)
    )


def _names_all(row: Sequence[str]) -> bool:
    """Return whether a row has a different name for each column; an index, as the first one, may have none."""
    return len(set(row)) == len(row) and all(row[1:])


def _are_units(row: Sequence[str]) -> bool:
    """Return whether most cells of a row are units, or stand in brackets as units do."""
    named = [cell for cell in row if cell]
    units = [
        cell for cell in named if cell.strip("[]()").lower() in UNITS or cell[0] + cell[-1] in ("[]", "()")
    ]
    return bool(named) and 2 * len(units) > len(named)


def _are_kinds(row: Sequence[str], *, followed: bool) -> bool:
    """Return whether a row says of which kinds the columns are; letters alone are units, if numbers follow."""
    kinds = {cell.lower() for cell in row} - {""}
    named = max(map(len, kinds), default=0) > 1 or ("c" in kinds and followed)
    return named and all(map(_KIND.fullmatch, kinds))


def _decimals(cell: str) -> int:
    """Return the digits behind the decimal point of a number, -1 for another text."""
    return len(cell.partition(".")[2]) if is_number(cell) and "e" not in cell.lower() else -1


def distinct_names(names: Sequence[str]) -> list[str]:
    """Return a name for each column: a second one of the same name gets `.1` behind it, as pandas writes it."""
    ordered: dict[str, None] = {}
    again = Counter[str]()
    for k, given in enumerate(names):
        name = wanted = given or (INDEX if k == 0 else f"c{k + 1}")
        while name in ordered:
            again[wanted] += 1
            name = f"{wanted}.{again[wanted]}"
        ordered[name] = None
    return list(ordered)


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
