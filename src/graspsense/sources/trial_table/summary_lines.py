"""Lines of a table that are the mean, the sum or another statistic of its trials."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container
from itertools import takewhile
from typing import TYPE_CHECKING, Final

from graspsense.core.values.errors import listed
from graspsense.sources.formats.text_table import numbers_with_unit

if TYPE_CHECKING:
    from graspsense.sources.formats.csv_columns import CsvColumns

_STATISTICS: Final = frozenset({
    "mean", "means", "average", "averages", "avg", "median", "mode", "sum", "total", "totals", "grand total",
    "subtotal", "count", "n", "std", "std dev", "stddev", "stdev", "sd", "sem", "standard deviation", "standard error",
    "variance", "var", "cv", "min", "max", "minimum", "maximum", "range", "25%", "50%", "75%", "overall",
    "mittel", "mittelwert", "durchschnitt", "summe", "gesamt", "anzahl", "standardabweichung", "stabw", "varianz",
    "moyenne", "somme", "médiane", "écart-type", "media", "promedio", "suma", "mediana", "somma", "totale",
    "gemiddelde", "totaal",
})  # fmt: skip


def without_summaries(columns: CsvColumns) -> None:
    """Remove the lines that are statistics of the others, or headings between them, with a note.

    In the first and the last lines, each has the name of a statistic that its column has nowhere else; an object of
    that name has several trials. Anywhere, the name stands beside that of other lines, as in `mean (can)`, or in a
    column of numbers, as that of a trial; a column of percentages has 50%. A heading is a text that its column has
    nowhere else, alone in its line.
    """
    summaries: dict[int, str] = {}
    alone = [sum(map(bool, row)) == 1 < len(row) - 1 for row in zip(*columns.cells.values(), strict=True)]
    rows = range(len(columns))
    for name, cells in columns.cells.items():
        words = [
            " ".join(cell.casefold().replace("_", " ").replace(".", " ").split()).strip(": ")
            for cell in cells
        ]
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


def _is_statistic(word: str, others: Container[str]) -> bool:
    """Return whether this is the name of a statistic, or that of one and of another line."""
    parts = re.split(r" of |[ ()]+", word.strip("()")) if word[:1].isalpha() else [""]
    return word in _STATISTICS or any(
        statistic in _STATISTICS and " ".join(other) in others
        for statistic, other in ((parts[0], parts[1:]), (parts[-1], parts[:-1]))
        if other
    )
