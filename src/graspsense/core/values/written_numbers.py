"""Numbers as programs write them. How a column is written is decided from all of its rows.

`1,000` is a thousand to one program and one to another. A cell alone cannot tell, so a column has one *notation*: the
decimal point, the decimal point with commas between thousands, or the decimal comma (with points between thousands). A
column whose cells fit no common notation is refused with the row, and so is one that two notations would read with
different values, unless the rest of the file decides.
"""

from __future__ import annotations

import math
import re
import unicodedata
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

from attrs import frozen

from graspsense.core.values.errors import listed

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    Numbers = NDArray[np.float64]

POINT: Final = 1
THOUSANDS: Final = 2
COMMA: Final = 4
HEXADECIMAL: Final = 8
"""`0x7D0`, beside `0` at most: any other number can be a hexadecimal one without its sign."""
_FEW: Final = 3
_THOUSAND: Final = 1000.0
_MUCH: Final = math.log(10.0)
"""Logarithm of how many times farther away a number is than another one that is much nearer."""
_EVERY: Final = POINT | THOUSANDS | COMMA
_NOTATIONS: Final = (POINT, THOUSANDS, COMMA)

_MISSING_WORDS: Final = frozenset({
    "", "na", "n/a", "n.a.", "<na>", "<missing>", "<undefined>", "nat", "null", "\\n", "none", "?", ".", "missing",
    "nothing", "nil", "(null)", "no data", "n.d.", "k.a.", "undef", "ol", "overload"
})  # fmt: skip
_MISSING: Final = re.compile(
    r"\*{4,}|#{2,}|[-+]?(?:nan(?:\(\w*\)|0x[0-9a-f]+)?|1[.,]#(?:q?nan|ind)\d*)|#[^\W\d][^!?]*[!?]|#[\u00a1\u00bf].*|#n/?[adv]|err:\d{3}|\.[a-z]",
    re.IGNORECASE,
)
"""Stars and hashes, as Fortran and spreadsheets write a number that is too wide, NaN of C, errors of spreadsheets in
their languages, such as `#WERT!`, and `.a` of Stata."""
_LONGEST_MISSING: Final = 20

_LOGICAL: Final = {"True": "1", "False": "0", "Wahr": "1", "Falsch": "0", "Vrai": "1", "Faux": "0"}

_PLAIN_SIGNS: Final = {
    **dict.fromkeys(map(ord, "\u02d7\u2010\u2011\u2012\u2013\u2014\u2212\u2796\ufe63\uff0d"), "-"),
    **dict.fromkeys([*map(ord, "\u00a0\u202f\u205f\u3000"), *range(0x2000, 0x200B)], " "),
    **dict.fromkeys(map(ord, "\u00b4\u02bc\u2018\u2019\u2032\u066c\uff07"), "'"),
    **dict.fromkeys(map(ord, "\u00b7\u066b\uff0e"), "."),
    **dict(zip(map(ord, "\uff0b\uff0c\u2248"), "+,~", strict=True)),
}
"""Signs and spaces of numbers as word processors have them."""
_ABOUT: Final = re.compile(r"~ ?(?=[-+.\d])|(?<=[\d.]) ?(?:(?:\u00b1|\+/?-) ?[\d.,]+|\([\d.,]+\)(?=$|[eE]))")
"""What says that a number is rounded, before it, and how uncertain it is, behind it."""
_POWER: Final = re.compile(
    r"(?<=[\d.]) ?[x*\u00d7\u00b7\u22c5] ?10(?:(?:\^|\*\*)([-+\u2212]?\d+)|([⁺⁻]?[⁰¹²³⁴-⁹]+))$"
)
"""`x 10^-3` behind a number."""


def _form(mark: str, whole: str, *groups: str) -> re.Pattern[str]:
    """Return the pattern of numbers with one of these before the mark of decimals; one with groups has no exponent."""
    digits = rf"(?:{whole}(?:{mark}[0-9]*)?|{mark}[0-9]+)(?:[ed][-+]?[0-9]+)?"
    number = rf"(?:{digits}|(?:{'|'.join(groups)})(?:{mark}[0-9]*)?|inf(?:inity)?)"
    return re.compile(rf"[-+]? ?{number}|\({number}\)", re.IGNORECASE)  # (0.5), as accountants write -0.5


_GROUPS: Final = "[1-9][0-9]{{0,2}}(?:{}[0-9]{{3}})+"
_OTHER_GROUPS: Final = _GROUPS.format("[ ']")
_INDIAN: Final = "[1-9][0-9]?(?:,[0-9]{2})+,[0-9]{3}"
"""1,00,000"""
_FORMS: Final = {
    POINT: _form(r"\.", "[0-9]+", _OTHER_GROUPS),
    THOUSANDS: _form(r"\.", "[0-9]{1,3}", _GROUPS.format(","), _INDIAN),  # 1000 would have a comma
    COMMA: _form(",(?=[0-9])", "[0-9]+", _OTHER_GROUPS, _GROUPS.format(r"\.")),
    HEXADECIMAL: re.compile("0|0x[0-9a-f]{1,16}", re.IGNORECASE),
}
_TO_PYTHON: Final = {
    POINT: str.maketrans("dD(", "ee-", " ')"),
    THOUSANDS: str.maketrans("dD(", "ee-", " '),"),
    COMMA: str.maketrans("dD,(", "ee.-", " ')."),
}
_ONE_MARK: Final = re.compile(r"[-+(]? ?[1-9][0-9]{0,2}[.,][0-9]{3}\)?")
"""A number of three decimals, or one of thousands."""
_PLAIN: Final = re.compile(r"[0-9+\-.eE]*")


@frozen
class NotNumbers:
    """Why a column is not a column of numbers: the index of the first cell that does not fit, and the reason."""

    row: int
    cell: str
    why: str
    """What follows behind the cell: `which is not a number`."""

    @property
    def words(self) -> str:
        """The cell and the reason."""
        return f"{self.cell[:40]!r}, {self.why}"


def is_missing(cell: str) -> bool:
    """Return whether the text of a cell stands for a missing number."""
    return len(cell) <= _LONGEST_MISSING and (
        plain_text(cell).lower().strip("-") in _MISSING_WORDS or _MISSING.fullmatch(cell) is not None
    )


def is_number(cell: str) -> bool:
    """Return whether a text is a number in any notation."""
    return _notations(plain_text(cell)) > 0


def plain_text(cell: str) -> str:
    r"""Return a number with the signs and digits of ASCII, and without what says how exact it is.

    Nor does it have the apostrophe of a spreadsheet or quotes around it.

    >>> [*map(plain_text, ("\u22121\u2019000", "'-0.5", "12\u202f000", "~\uff11.5 \u00b1 0.2", "1.5 (2)"))]
    ["-1'000", '-0.5', '12 000', '1.5', '1.5']
    >>> [*map(plain_text, ("1.5\u00d710\u207b\u00b3", "0.5-"))]  # the second as SAP writes -0.5
    ['1.5e-3', '(0.5)']
    """
    if "10" in cell:
        cell = _POWER.sub(lambda match: f"e{unicodedata.normalize('NFKC', match[1] or match[2])}", cell)
    if not cell.isascii():
        cell = cell.translate(_PLAIN_SIGNS).strip()
    if not cell.isascii():  # digits of other scripts
        cell = "".join(str(unicodedata.decimal(sign, sign)) for sign in cell)
    if "~" in cell or "\u00b1" in cell or "+" in cell or "(" in cell:
        cell = _ABOUT.sub("", cell)
    if cell.endswith("-") and cell[0].isdigit():
        cell = f"({cell[:-1]})"
    return cell.strip("'") if cell.startswith("'") else cell


def number_in(text: str) -> float | None:
    """Return the finite number that a text on its own is, None if it is none or can be read as two different ones."""
    column = columns_of_numbers({"": [text.strip()]})[""]
    return None if isinstance(column, NotNumbers) or not math.isfinite(column[0]) else float(column[0])


def truths(cells: Sequence[str]) -> Numbers | None:
    """Return 1 for each true and 0 for each false, in any case, NaN where missing; None if a cell is another word."""
    known = [_LOGICAL.get(cell.capitalize(), "") for cell in cells]
    every = all(word or is_missing(cell) for word, cell in zip(known, cells, strict=True))
    return _values(known, POINT) if every and any(known) else None


def rows_of_lists(cells: Sequence[str]) -> Numbers | None:
    """Return the numbers of cells that are lists, as Python and numpy print them; True is 1, False 0, and None missing.

    None if a cell is no list of numbers, or has another length than the first one.
    """
    known = all(cell.startswith("[") and cell.endswith("]") for cell in cells)
    rows = [cell[1:-1].replace(",", " ").split() for cell in cells]
    words = [_LOGICAL.get(word.capitalize(), word) for row in rows for word in row]
    known &= all(_FORMS[POINT].fullmatch(word) or is_missing(word) for word in words)
    same = len({*map(len, rows)}) == 1 and bool(words)
    return _values(words, POINT).reshape(len(rows), -1) if known and same else None


def columns_of_numbers(
    columns: Mapping[str, Sequence[str]], *, decimal_commas: bool = False
) -> dict[str, Numbers | NotNumbers]:
    """Return the numbers of each column of a file, NaN where missing, or why it has none.

    With `decimal_commas`, a comma before three digits is that of decimals where nothing else tells: a file whose cells
    are separated by semicolons is from such a program.

    >>> {name: found.tolist() for name, found in columns_of_numbers({"N": ["0", "1,5"], "mm": ["2", "1.000"]}).items()}
    {'N': [0.0, 1.5], 'mm': [2.0, 1000.0]}
    """
    columns = {name: [*map(plain_text, cells)] for name, cells in columns.items()}
    fits = {name: _common(cells) for name, cells in columns.items()}
    certain = [fit for fit in fits.values() if isinstance(fit, int)]
    points = any(not notations & COMMA for notations in certain if notations != HEXADECIMAL)
    commas = any(notations == COMMA for notations in certain)
    of_file = (COMMA if commas else 0) | (THOUSANDS if points else 0)
    return {
        name: fit if isinstance(fit, NotNumbers) else _read(columns[name], fit, of_file, decimal_commas)
        for name, fit in fits.items()
    }


def doubts_of_marks(
    columns: Mapping[str, Sequence[str]], read: Mapping[str, Numbers | NotNumbers], separator: str
) -> tuple[str, ...]:
    """Return notes on columns whose numbers of three decimals can be thousands, or the other way round.

    Decimals are doubted between semicolons, unless a number of the file has others; thousands, except between commas,
    where all of a column have three digits behind one sign, so that only other columns tell what it is.

    >>> columns = {"mN": ["12,008", "9,500"], "mm": ["4.5", "5"]}
    >>> doubts_of_marks(columns, columns_of_numbers(columns), "\\t")  # doctest: +ELLIPSIS
    ('the sign before three digits in mN is taken for that of thousands. If it is ...',)
    """
    doubtful: dict[str, list[str]] = {"decimals": [], "thousands": []}
    told = separator != ";"
    for name, cells in columns.items() if separator not in ("", ",") else ():
        numbers, plain = read[name], [*map(plain_text, cells)]
        marked = [k for k, cell in enumerate(plain) if ("." in cell or "," in cell) and _notations(cell)]
        if isinstance(numbers, NotNumbers) or not marked:
            continue
        if not all(_ONE_MARK.fullmatch(plain[k]) for k in marked):
            told = True
        elif abs(numbers[marked[0]]) < _THOUSAND:
            doubtful["decimals"].append(name)
            told |= "," in plain[marked[0]] and _tells_thousands(plain)
        elif not (abs(numbers) < _THOUSAND).any():
            doubtful["thousands"].append(name)
    if told:
        del doubtful["decimals"]
    return tuple(
        f"the sign before three digits in {listed(names)} is taken for that of {taken}. If it is not, write a decimal "
        "point, and nothing between thousands"
        for taken, names in doubtful.items()
        if names
    )


def _common(cells: Sequence[str]) -> int | NotNumbers:
    """Return the notations that every cell fits, or why there is none."""
    if _plain_numbers(cells) is not None:
        return POINT | COMMA if all(map(_FORMS[COMMA].fullmatch, cells)) else POINT
    common = _EVERY | HEXADECIMAL
    for row, cell in enumerate(cells):
        if is_missing(cell):
            continue
        fits = _notations(cell)
        if not fits:
            return NotNumbers(row, cell, "which is not a number; a missing one is an empty cell")
        common &= fits
        if not common:
            return NotNumbers(
                row, cell, "which has other marks than the cells above: write a decimal point alone"
            )
    given = [row for row, cell in enumerate(cells) if not is_missing(cell)]
    if given and all(cells[row].startswith("(") for row in given):
        why = "and all cells have parentheses or a minus sign last: write the minus sign first"
        return NotNumbers(given[0], cells[given[0]], why)
    return common


def _read(cells: Sequence[str], common: int, of_file: int, decimal_commas: bool) -> Numbers | NotNumbers:
    """Return the numbers; `of_file` holds COMMA and THOUSANDS where other columns prove decimal commas or points."""
    if common & POINT:
        # `1.500` is 1500 where all other columns have decimal commas, and beside 975 and 1.000.
        grouped = common & COMMA and any("." in cell for cell in cells)
        likely = _nearer(cells, of_file == THOUSANDS) | (of_file & COMMA) if grouped else POINT
        if likely == POINT or (likely == POINT | COMMA and of_file == THOUSANDS):
            return _values(cells, POINT)
        if not of_file & THOUSANDS and (likely == COMMA or of_file):
            return _values(cells, COMMA)
    elif (common == THOUSANDS and of_file & COMMA) or _one_mark_of_two(cells):
        pass
    elif common == THOUSANDS | COMMA:
        if of_file == COMMA:
            return _values(cells, COMMA)
        if of_file == THOUSANDS or _tells_thousands(cells):
            return _values(cells, THOUSANDS)
        if decimal_commas and not of_file:
            return _values(cells, COMMA)
    else:
        return _values(cells, common)
    mark = "," if common & POINT == 0 else "."
    row = next(k for k, cell in enumerate(cells) if mark in cell and not is_missing(cell))
    able = [notation for notation in _NOTATIONS if _notations(cells[row]) & notation]
    readings = " or ".join(dict.fromkeys(f"{_values([cells[row]], notation)[0]:.15g}" for notation in able))
    return NotNumbers(
        row, cells[row], f"which can be {readings}: write a decimal point, and nothing between thousands"
    )


def _nearer(cells: Sequence[str], of_points: bool) -> int:
    """Return POINT, COMMA or both: in which the largest number without a mark is much nearer to one with a point.

    A program that writes three decimals writes them in every cell, so that 950 beside 1.203 is hardly 950.000.
    """
    sizes = [(cell, abs(_number(cell, POINT))) for cell in cells if not is_missing(cell)]
    sizes = [(cell, size) for cell, size in sizes if 0.0 < size < math.inf]
    with_point = [size for cell, size in sizes if "." in cell]
    plain = max((size for cell, size in sizes if "." not in cell), default=0.0)
    if plain == 0.0 or not with_point:
        return POINT
    others = {cell for cell, _ in sizes if "." not in cell}
    if of_points and len(others) == 1 and (min(others) < "0" or len(sizes) - len(with_point) > 1):
        return POINT  # -999 beside 1.203, which stands for a missing value
    ones, thousands = (
        min(abs(math.log(factor * size / plain)) for size in with_point) for factor in (1.0, _THOUSAND)
    )
    return (POINT if ones < thousands + _MUCH else 0) | (COMMA if thousands < ones + _MUCH else 0)


def _tells_thousands(cells: Sequence[str]) -> bool:
    """Return whether a sign tells that commas before three digits separate thousands.

    A program that writes three decimals writes them in every cell, and one that leaves out zeros leaves out the last.
    """
    plain = [cell for cell in cells if "," not in cell and not is_missing(cell)]
    return bool(plain) and (
        any(cell.endswith("0") for cell in cells if "," in cell)
        or any(len(cell.lstrip("+-")) == 3 for cell in plain)
    )


def _one_mark_of_two(cells: Sequence[str]) -> bool:
    """Return whether these are `1,250` and `1.31`: decimals behind the mark of one place and of another.

    Of thousands with decimals, some have both marks.
    """
    marks = ["" if is_missing(cell) else re.sub("[^,.]", "", cell) for cell in cells]
    return {*marks} - {""} == {",", "."} and (
        marks.count(",") >= _FEW or all(len(cell) - cell.find(".") == 4 for cell in cells if "." in cell)
    )


def _values(cells: Sequence[str], notation: int) -> Numbers:
    import numpy as np

    if notation == POINT and (plain := _plain_numbers(cells)) is not None:
        return plain
    numbers = [math.nan if is_missing(cell) else _number(cell, notation) for cell in cells]
    return np.array(numbers, dtype=np.float64)


def _plain_numbers(cells: Sequence[str]) -> Numbers | None:
    """Return cells with only digits, signs, points and exponents as numbers; None if one of them is none."""
    import numpy as np

    try:
        return (
            np.array(list(map(float, cells)), dtype=np.float64) if _PLAIN.fullmatch("".join(cells)) else None
        )
    except ValueError:
        return None


def _number(cell: str, notation: int) -> float:
    return float(int(cell, 16) if notation == HEXADECIMAL else cell.translate(_TO_PYTHON[notation]))


def _notations(cell: str) -> int:
    """Return the notations in which a cell is a number."""
    return sum(notation for notation, form in _FORMS.items() if form.fullmatch(cell))
