"""Reading ARFF files, the text format of Weka for tables.

Source: Weka manual, chapter "ARFF" (attribute declarations, sparse rows, instance weights, quoting).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np

from graspsense_c45.table import MISSING_CLASS, Attribute, Schema, Table, make_table

_TOKEN = re.compile(r"""[\s,]*(?:'((?:\\.|[^'\\])*)'|"((?:\\.|[^"\\])*)"|([{}])|([^\s,{}'"][^\s,{}]*))""")
_ESCAPE = re.compile(r"\\(.)")
_ESCAPED = {"n": "\n", "t": "\t", "r": "\r"}
_OPEN, _CLOSE, _MISSING = ("{", False), ("}", False), ("?", False)
_NUMERIC = ("numeric", "real", "integer")
MOST_BYTES = 2**28
"""Limit on the size of a file."""
MOST_ATTRIBUTES = 10_000
"""Limit on the attributes, and on the values of one, of a file."""
MOST_NAMED = 24
"""Limit on the names that an error lists."""
LONGEST_SHOWN = 60
"""Limit on the characters of a text that an error repeats."""


Token = tuple[str, bool]
"""A word, and whether it is quoted."""


class ArffError(ValueError):
    """An ARFF file that cannot be read; the message names the file, the line, what it holds and what is allowed."""


def read_arff(path: str | Path, class_attribute: str | None = None) -> Table:
    """Return the table in an ARFF file.

    class_attribute: the name of the nominal attribute that is the class; by default the last attribute.
    Numeric and nominal attributes, dense and sparse rows, instance weights and missing values (``?``) are read.

    Raises ArffError for anything else, with its line.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            data = file.read(MOST_BYTES + 1)
        text = data.decode("utf-8-sig")
    except OSError as error:
        raise ArffError(f"{path} cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ArffError(f"{path}: not UTF-8 text (byte {error.start}); save the file as UTF-8") from None
    if len(data) > MOST_BYTES:
        raise ArffError(f"{path}: a file has at most {MOST_BYTES} bytes, and this has more")
    return parse_arff(text, class_attribute, str(path))


def parse_arff(text: str, class_attribute: str | None = None, source: str = "<text>") -> Table:
    """Return the table in an ARFF text; see `read_arff`. `source` is named in errors."""
    reader = _Reader(source)
    for number, line in enumerate(text.splitlines(), start=1):
        reader.take(number, line)
    return reader.table(class_attribute)


class _Reader:
    def __init__(self, source: str) -> None:
        self._source, self._line = source, 0
        self._attributes: list[Attribute] = []
        self._codes: list[dict[str, int]] = []
        self._rows: list[list[float]] = []
        self._weights: list[float] = []
        self._in_data = False

    def take(self, number: int, line: str) -> None:
        self._line = number
        line = line.strip()
        if not line or line.startswith("%"):
            return
        if self._in_data:
            self._row(line)
            return
        keyword, _, declaration = re.sub(r"\s", " ", line).partition(" ")
        if keyword.lower() == "@attribute":
            self._attribute(declaration)
        elif keyword.lower() == "@data":
            self._in_data = True
            if not self._attributes:
                raise self._error("@data without any @attribute before it; declare the columns first")
        elif keyword.lower() != "@relation":
            raise self._error(f"found {keyword!r}; allowed here: @relation, @attribute, @data, % comments")

    def table(self, class_attribute: str | None) -> Table:
        if not self._in_data:
            raise ArffError(f"{self._source}: no @data line; is this an ARFF file?")
        if not self._rows:
            raise ArffError(f"{self._source}: no rows after @data; there is nothing to learn")
        names = [attribute.name for attribute in self._attributes]
        if class_attribute is not None and class_attribute not in names:
            raise ArffError(f"{self._source}: no attribute {class_attribute!r}; there are {_listed(names)}")
        class_column = len(names) - 1 if class_attribute is None else names.index(class_attribute)
        classes = self._attributes[class_column].values
        if classes is None:
            raise ArffError(
                f"{self._source}: the class {names[class_column]!r} is numeric; name a nominal attribute as the class"
            )
        values = np.array(self._rows)
        labels = np.where(np.isnan(values[:, class_column]), MISSING_CLASS, values[:, class_column]).astype(
            np.int64
        )
        schema = Schema(tuple(a for i, a in enumerate(self._attributes) if i != class_column), classes)
        try:
            return make_table(
                schema, np.delete(values, class_column, axis=1), labels, np.array(self._weights)
            )
        except ValueError as error:
            raise ArffError(f"{self._source}: {error}") from None

    def _attribute(self, declaration: str) -> None:
        tokens = list(islice(self._tokens(declaration), MOST_ATTRIBUTES + 3))
        if len(tokens) < 2:
            raise self._error("write @attribute NAME numeric or @attribute NAME {a, b}")
        name, kind = tokens[0][0], tokens[1][0]
        if len(self._attributes) >= MOST_ATTRIBUTES:
            raise self._error(f"a table has at most {MOST_ATTRIBUTES} attributes, and this has more")
        if tokens[1] == _OPEN:
            values = tuple(value for value, _ in tokens[2:-1])
            if tokens[-1] != _CLOSE or len(set(values)) != len(values) or not values:
                raise self._error(
                    f"the values of {name!r} are {_listed(values)}; there must be some, each once, at most "
                    f"{MOST_ATTRIBUTES}, and end with }}"
                )
            self._attributes.append(Attribute(name, values=values))
            self._codes.append({value: code for code, value in enumerate(values)})
        elif kind.lower() in _NUMERIC:
            self._attributes.append(Attribute(name))
            self._codes.append({})
        else:
            raise self._error(
                f"attribute {name!r} is {kind[:LONGEST_SHOWN]!r}; allowed: {', '.join(_NUMERIC)}, or {{value, value}}"
            )

    def _row(self, line: str) -> None:
        tokens = list(self._tokens(line))
        sparse = tokens[:1] == [_OPEN]
        last = _CLOSE if sparse else _OPEN  # behind which there can be a weight
        end = tokens.index(last) if last in tokens else len(tokens)
        cells = self._sparse(tokens[1:end]) if sparse else tokens[:end]
        weights = [token for token, _ in tokens[end + 1 :] if token not in "{}"]
        if len(cells) != len(self._attributes):
            raise self._error(f"{len(cells)} values; there are {len(self._attributes)} attributes")
        self._rows.append([self._cell(i, cell) for i, cell in enumerate(cells)])
        self._weights.append(self._number(weights[0], "the weight") if weights else 1.0)

    def _sparse(self, tokens: Sequence[Token]) -> list[Token]:
        cells = [("0" if a.values is None else a.values[0], False) for a in self._attributes]
        for (index, _), cell in zip(tokens[::2], tokens[1::2], strict=False):
            if not index.isdecimal() or len(index) > len(str(len(cells))) or int(index) >= len(cells):
                raise self._error(f"sparse index {index[:LONGEST_SHOWN]!r}; allowed: 0..{len(cells) - 1}")
            cells[int(index)] = cell
        return cells

    def _cell(self, column: int, cell: Token) -> float:
        if cell == _MISSING:
            return float("nan")
        attribute = self._attributes[column]
        if attribute.values is None:
            return self._number(cell[0], attribute.name)
        code = self._codes[column].get(cell[0])
        if code is None:
            raise self._error(
                f"{attribute.name} is {cell[0][:LONGEST_SHOWN]!r}; declared: {_listed(attribute.values)}"
            )
        return float(code)

    def _number(self, cell: str, name: str) -> float:
        try:
            return float(cell)
        except ValueError:
            raise self._error(
                f"{name} is {cell[:LONGEST_SHOWN]!r}; it must be a number, or ? where missing"
            ) from None

    def _tokens(self, text: str) -> Iterator[Token]:
        """Yield the words of a line, and whether each is quoted, up to a comment."""
        position, text = 0, text.rstrip(" \t,")
        while position < len(text):
            match = _TOKEN.match(text, position)
            if match is None:
                wrong = text[position : position + LONGEST_SHOWN].strip()
                raise self._error(f"cannot read {wrong!r} as a value; quote it, or write ? where missing")
            single, double, brace, word = match.groups()
            if word is not None and word.startswith("%"):
                return
            quoted = double if single is None else single
            if quoted is None:
                yield brace or word, False
            else:
                yield _ESCAPE.sub(lambda escape: _ESCAPED.get(escape[1], escape[1]), quoted), True
            position = match.end()

    def _error(self, message: str) -> ArffError:
        return ArffError(f"{self._source}:{self._line}: {message}")


def _listed(names: Sequence[str]) -> str:
    more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
    return ", ".join(name[:LONGEST_SHOWN] for name in names[:MOST_NAMED]) + more
