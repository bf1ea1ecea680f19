"""Writing CSV whose texts a spreadsheet shows and never runs, and the way back to these texts.

A spreadsheet takes a cell that begins with one of `= + - @` for a formula, which can start a program or send data away.
Texts come from data: labels, names of objects and features, notes. An apostrophe before such a beginning makes it text,
also behind a character at which a spreadsheet with other settings would divide the cell. Numbers stay as they are.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Sequence
from typing import Final

_BEGINNING: Final = r"=+\-@\uff1d\uff0b\uff0d\uff20\u2212"
"""The characters that begin a formula, also in their full width."""
_DIVIDED: Final = r'(?:^|[;\t\r\n])(?:[^\S\t\r\n]|")*'
"""Where another cell may begin; quotes there may be taken for those of the cell."""
_WRITTEN: Final = re.compile(rf"({_DIVIDED})('*[{_BEGINNING}])")
_READ: Final = re.compile(rf"({_DIVIDED})'('*[{_BEGINNING}])")
_PASSED_OVER: Final = re.compile(r"'*[\t\r\n]")
"""What a spreadsheet passes over at the beginning of a cell."""
_NUMBER: Final = re.compile(r"[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?")


def csv_text(rows: Iterable[Sequence[object]]) -> str:
    """Return rows as CSV: texts without formulas, floats so that they are read back as the same, NaN and None empty."""
    return "".join(_line([_cell(value) for value in row]) for row in rows)


def text_of_cell(cell: str) -> str:
    """Return the text that `csv_text` wrote into this cell; another cell is returned as it is."""
    if "'" not in cell:
        return cell
    if cell.startswith("'") and _PASSED_OVER.match(cell):
        cell = cell[1:]
    return _READ.sub(r"\1\2", cell)


def _line(cells: Sequence[str]) -> str:
    # The writer of Python does not quote a carriage return on its own.
    quoted = [
        '"' + cell.replace('"', '""') + '"' if any(c in cell for c in ',;"\t\r\n') else cell for cell in cells
    ]
    return (",".join(quoted) or '""') + "\n"


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and math.isnan(value)):
        return ""
    if isinstance(value, str):
        if _NUMBER.fullmatch(value):
            return value
        text = _WRITTEN.sub(r"\1'\2", value)
        return f"'{text}" if _PASSED_OVER.match(text) else text
    return repr(value) if isinstance(value, float) else str(value)
