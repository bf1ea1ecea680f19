"""Lines of a table that are the mean, the sum or another statistic of its trials."""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Container, Sequence
from decimal import Decimal, InvalidOperation
from itertools import chain, groupby, pairwise, takewhile
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.learn.confounding import LEAST_LINES
from graspsense.core.values.errors import listed
from graspsense.sources.columns.channel_facts import resolution
from graspsense.sources.formats.text_table import numbers_with_unit

if TYPE_CHECKING:
    from graspsense.sources.formats.csv_columns import CsvColumns
    from graspsense.sources.formats.table import Numbers

_STATISTICS: Final = frozenset({
    "mean", "means", "average", "averages", "avg", "median", "mode", "sum", "total", "totals", "grand total",
    "subtotal", "count", "n", "std", "std dev", "stddev", "stdev", "sd", "sem", "standard deviation", "standard error",
    "variance", "var", "cv", "min", "max", "minimum", "maximum", "range", "25%", "50%", "75%", "overall",
    "mittel", "mittelwert", "durchschnitt", "summe", "gesamt", "anzahl", "standardabweichung", "stabw", "varianz",
    "moyenne", "somme", "médiane", "écart-type", "media", "promedio", "suma", "mediana", "somma", "totale",
    "gemiddelde", "totaal",
})  # fmt: skip
_MOST_LAST: Final = 20
"""Most lines of statistics at the end."""
_ENOUGH_COLUMNS: Final = 20
_BY_CHANCE: Final = 1e-4
"""Probability of drawn numbers to be a mean, as far as they are written, below which they are one,"""
_COMPARED: Final = 200
"""and that of numbers whose line has only texts of other lines is so many times less: so many lines are compared."""
_ON_GRID: Final = 1e-6
_ROUNDING: Final = 1e-9
"""Relative error of a mean that is written with all its digits."""


def without_summaries(columns: CsvColumns) -> None:
    """Remove the lines that are statistics of the others, or headings between them, with a note.

    In the first and the last lines, each has the name of a statistic that its column has nowhere else; an object of
    that name has several trials. Anywhere, the name stands beside that of other lines, as in `mean (can)`, or in a
    column of numbers, as that of a trial; a column of percentages has 50%. A heading is a text that its column has
    nowhere else, alone in its line. Means and sums of the lines above are known by their numbers, in any language; with
    the name of a statistic also those of each group of lines.
    """
    summaries = {i: next(cells[i] for cells in columns.cells.values()) for i in _computed(columns)}
    alone = [sum(map(bool, row)) == 1 < len(row) - 1 for row in zip(*columns.cells.values(), strict=True)]
    rows = range(len(columns))
    for name, cells in columns.cells.items():
        words = [_word(cell) for cell in cells] if columns.numbers_or_none(name) is None else cells
        times = Counter(words)
        telling = [
            word != "" and times[word] == 1 and (lone or _is_statistic(word, times))
            for word, lone in zip(words, alone, strict=True)
        ]
        ends = {*takewhile(telling.__getitem__, rows), *takewhile(telling.__getitem__, reversed(rows))}
        summaries |= {
            i: cells[i] for i in rows if telling[i] and (i in ends or alone[i] or words[i] not in _STATISTICS)
        }
        if not (_STATISTICS.isdisjoint(times) or numbers_with_unit(cells)[1]) and columns.has_numbers(name):
            summaries |= {i: cells[i] for i, word in enumerate(words) if word in _STATISTICS}
    if 0 < len(summaries) < len(columns):
        columns.notes = (
            *columns.notes,
            "left out, because they are statistics of other lines, or headings: "
            + listed([f"line {columns.lines[i]} ({summaries[i]})" for i in sorted(summaries)]),
        )
        columns.keep([i for i in range(len(columns)) if i not in summaries])


@np.errstate(over="ignore", invalid="ignore")  # of numbers that no sensor gives
def _computed(columns: CsvColumns) -> set[int]:
    """Return the lines that are a mean or the sum of lines above them, as no trial is by chance, and those beside them.

    They are the last lines, or have the names of statistics behind most groups of lines.
    """
    read = {name: columns.numbers_or_none(name) for name in columns.names}
    finite = [name for name, values in read.items() if values is not None and not np.isinf(values).any()]
    finite, n = finite[:_ENOUGH_COLUMNS], len(columns)
    numbers = np.array([read[name] for name in finite]).T
    texts = [columns.cells[name] for name, values in read.items() if values is None]

    def is_of(lines: Sequence[int], i: int, *, named: bool) -> bool:
        places = [
            _places(columns.cells[name][i], number) for name, number in zip(finite, numbers[i], strict=True)
        ]
        chance = _chance_of_mean_or_sum(numbers[lines], numbers[i], np.array(places, dtype=np.float64))
        return chance < (_BY_CHANCE if named else _BY_CHANCE / _COMPARED)

    def is_computed(i: int, begin: int) -> bool:
        alike = ([k for k in range(i) if cells[k] == cells[i]] for cells in texts if begin == i)
        named = any(cells[i] not in cells[:i] for cells in texts)
        return any(
            len(lines) >= LEAST_LINES and is_of(lines, i, named=named) for lines in (range(begin), *alike)
        )

    able = range(n - 1, max(n // 2, n - _MOST_LAST) - 1, -1) if finite else range(0)
    begin = next((k for k in able if any(is_computed(i, k) for i in range(k, n))), n)
    while begin - 1 in able and is_computed(begin - 1, begin - 1):
        begin -= 1
    statistics = [any(_word(cells[i]) in _STATISTICS for cells in texts) for i in range(n if finite else 0)]
    runs = pairwise([*run] for _, run in groupby(range(len(statistics)), statistics.__getitem__))
    behind = [(lines, run) for lines, run in runs if statistics[run[0]]]
    known = sum(any(is_of(lines, i, named=True) for i in run) for lines, run in behind)
    return {*range(begin, n), *chain(*(run for _, run in behind if 2 * known > len(behind)))}


def _places(cell: str, number: float) -> int:
    """Return the decimal places with which a number is written; those that it needs where its text has other signs."""
    try:
        written = Decimal(cell.replace(",", "."))
    except InvalidOperation:
        written = Decimal(repr(float(number))).normalize()
    return max(0, -int(written.as_tuple().exponent)) if written.is_finite() else 0


def _chance_of_mean_or_sum(lines: Numbers, line: Numbers, places: Numbers) -> float:
    """Return the probability that drawn numbers are the means, or the sums, of several lines; 1 if these are not.

    They are written with so many decimal places.
    """
    used = ~np.isnan(line) & ~np.isnan(lines).any(axis=0)
    used &= lines.max(axis=0) > lines.min(axis=0)
    lines, line = lines[:, used], line[used]
    errors = np.maximum(_ROUNDING * np.abs(line), 0.5 * 10.0 ** -places[used])
    if not any(
        (np.abs(line - statistic(lines, axis=0)) <= 1.001 * errors).all() for statistic in (np.mean, np.sum)
    ):
        return 1.0
    chance = 1.0
    for number, error, values in zip(line.tolist(), errors.tolist(), lines.T, strict=True):
        step, span = resolution(values) or math.inf, float(np.ptp(values))
        place = (number - float(values[0])) / step
        # A mean has more digits than the trials, and a sum is larger. Another number may be equal to a trial's.
        alike = abs(place - round(place)) < _ON_GRID and values.min() <= number <= values.max()
        chance *= min(1.0, (step if alike else 2.0 * error) / span / float(np.std(values / span)))
    return chance


def _word(cell: str) -> str:
    return " ".join(cell.casefold().replace("_", " ").replace(".", " ").split()).strip(": ")


def _is_statistic(word: str, others: Container[str]) -> bool:
    """Return whether this is the name of a statistic, or that of one and of another line."""
    parts = re.split(r" of |[ ()]+", word.strip("()")) if word[:1].isalpha() else [""]
    return word in _STATISTICS or any(
        statistic in _STATISTICS and " ".join(other) in others
        for statistic, other in ((parts[0], parts[1:]), (parts[-1], parts[:-1]))
        if other
    )
