"""An ARFF file, the format of Weka for tables, as named columns: its header says what is a number and what is not.

Read are numeric, nominal, string and date attributes, dense and sparse rows, weights (which are not used) and missing
values (`?`). The class is the last attribute, unless another one is named.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Final

from graspsense.core.learn.target_value import name_and_unit
from graspsense.core.values.errors import DataDamaged, listed
from graspsense.core.values.limits import CELLS
from graspsense.sources.formats.csv_columns import CsvColumns
from graspsense.sources.formats.text_table import check_columns, read_lines

_TOKEN: Final = re.compile(
    r"""[\s,]*(?:'((?:\\.|[^'\\])*)'|"((?:\\.|[^"\\])*)"|([{}])|([^\s,{}'"][^\s,{}]*))"""
)
_ESCAPE: Final = re.compile(r"\\(.)")
_ESCAPED: Final = {"n": "\n", "t": "\t", "r": "\r"}
_NUMBERS: Final = frozenset({"numeric", "real", "integer"})
_TEXTS: Final = frozenset({"string", "date"})
_SHOWN: Final = 40
_Token = tuple[str, bool]
"""A word, and whether it is quoted."""
_OPEN: Final = ("{", False)
_CLOSE: Final = ("}", False)
_MISSING: Final = ("?", False)


class ArffColumns(CsvColumns):
    """The columns of an ARFF file. Raises ConfigError or DataDamaged if the file cannot be read as a table."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.names, self.units, self.levels = [], {}, {}
        self.lines, self.notes = [], ()
        self._rows: list[list[str]] = []
        self.weighted = False
        in_data = False
        for self._line, line in read_lines(path)[0]:
            line = line.strip()
            if not line or line.startswith("%"):
                continue
            if in_data:
                self._take_row(line)
                continue
            keyword, _, declared = re.sub(r"\s", " ", line).partition(" ")
            if keyword.lower() == "@attribute":
                self._declare(declared)
            elif keyword.lower() == "@data":
                in_data = True
            elif keyword.lower() != "@relation":
                raise self._damaged(
                    f"found {keyword[:_SHOWN]!r}: a header has @relation, @attribute and @data"
                )
        if not in_data or not self._rows or not self.names:
            raise DataDamaged(f"{path} has no rows of attributes: it needs @attribute lines, @data and rows")
        self.cells = {name: [row[k] for row in self._rows] for k, name in enumerate(self.names)}
        self.default_label = self.names[-1] if self.names[-1] in self.levels else None  # the class attribute

    def without_label(self, label: str) -> list[str]:
        """Leave out the rows whose class is missing, as Weka does, and return notes on what is not used."""
        notes = ["the weights of the rows are not used"] if self.weighted else []
        having = [text != "" for text in self.texts(label)] if label in self.cells else []
        return notes + (self.keep_where(having, f"no {label}") if any(having) else [])

    def is_missing_text(self, cell: str) -> bool:
        """Return whether a text is missing: only `?` is, which is kept as an empty one."""
        return not cell

    def _declare(self, declared: str) -> None:
        tokens = list(self._tokens(declared))
        if len(tokens) < 2:
            raise self._damaged("write @attribute NAME numeric, or @attribute NAME {a, b}")
        name, unit = name_and_unit(tokens[0][0])
        if not name or name in self.units:
            raise self._damaged(f"attribute {name!r} has no name, or that of another one")
        kind = tokens[1][0].lower()
        if tokens[1] == _OPEN:
            values = [value for value, _ in tokens[2:-1]]
            if tokens[-1] != _CLOSE or not values or len(set(values)) < len(values):
                raise self._damaged(f"the values of {name!r} need braces, and each of them is there once")
            self.levels[name] = tuple(values)
        elif kind in _TEXTS:
            self.levels[name] = ()
        elif kind not in _NUMBERS:
            raise self._damaged(
                f"attribute {name!r} is {kind[:_SHOWN]!r}: allowed are {', '.join(sorted(_NUMBERS | _TEXTS))}, "
                "{value, value}"
            )
        self.names.append(name)
        self.units[name] = unit
        check_columns(self.path, self.names)

    def _take_row(self, line: str) -> None:
        tokens = list(self._tokens(line))
        sparse = tokens[:1] == [_OPEN]
        last = _CLOSE if sparse else _OPEN  # behind which there can be a weight
        end = tokens.index(last) if last in tokens else len(tokens)
        given = self._sparse(tokens[1:end]) if sparse else tokens[:end]
        cells, weight = ["" if token == _MISSING else token[0] for token in given], tokens[end + sparse :]
        self.weighted = self.weighted or bool(weight)
        if len(cells) != len(self.names):
            raise self._damaged(f"{len(cells)} values, but the header declares {len(self.names)} attributes")
        if too_many := CELLS.exceeded((len(self._rows) + 1) * len(self.names)):
            raise DataDamaged(f"{self.path}: {too_many}")
        for name, cell in zip(self.names, cells, strict=True):
            allowed = self.levels.get(name)
            if cell and allowed and cell not in allowed:
                raise self._damaged(f"{name} is {cell[:_SHOWN]!r}, and declared are {listed(allowed)}")
        self._rows.append(cells)
        self.lines.append(self._line)

    def _sparse(self, tokens: Sequence[_Token]) -> list[_Token]:
        """Return the cells of a sparse row: what it leaves out is 0, or the first value of a nominal attribute."""
        cells = [(next(iter(self.levels.get(name, ("0",))), ""), True) for name in self.names]
        for (place, _), cell in zip(tokens[::2], tokens[1::2], strict=False):
            if not place.isdecimal() or len(place) > len(str(len(cells))) or int(place) >= len(cells):
                raise self._damaged(f"{place[:_SHOWN]!r} is not the number of an attribute, counted from 0")
            cells[int(place)] = cell
        return cells

    def _tokens(self, text: str) -> Iterator[_Token]:
        """Yield the words of a line, and whether each is quoted, up to a comment."""
        place, text = 0, text.rstrip(" \t,")
        while place < len(text):
            match = _TOKEN.match(text, place)
            if match is None:
                raise self._damaged(f"cannot read {text[place : place + _SHOWN]!r}: is a quote missing?")
            single, double, brace, word = match.groups()
            if word is not None and word.startswith("%"):
                return
            quoted = single if single is not None else double
            if quoted is not None:
                yield _ESCAPE.sub(lambda match: _ESCAPED.get(match[1], match[1]), quoted), True
            else:
                yield brace or word, False
            place = match.end()

    def _damaged(self, why: str) -> DataDamaged:
        return DataDamaged(f"{self.path}, line {self._line}: {why}")
