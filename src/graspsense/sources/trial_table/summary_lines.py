"""Lines of a table that are the mean, the sum or another statistic of its trials."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Container
from typing import TYPE_CHECKING, Final

from graspsense.core.values.errors import listed

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
    """Remove the lines that are statistics of the others, with a note.

    In the last lines, each has the name of a statistic that its column has nowhere else, alone or beside the name of
    another line, as in `mean (can)`; an object of that name has several trials. A heading may stand above them.
    Anywhere, the name stands in a column of numbers, as that of a trial.
    """
    summaries: dict[int, str] = {}
    for name, cells in columns.cells.items():
        words = [
            " ".join(cell.casefold().replace("_", " ").replace(".", " ").split()).strip(": ")
            for cell in cells
        ]
        times = Counter(words)
        last = len(cells)
        while last and times[words[last - 1]] == 1 and _is_statistic(words[last - 1], times):
            last -= 1
        if 0 < last < len(cells) and sum(bool(column[last - 1]) for column in columns.cells.values()) == 1:
            last -= 1
        rows = set(range(last, len(cells)))
        if not _STATISTICS.isdisjoint(times) and columns.has_numbers(name):
            rows |= {i for i, word in enumerate(words) if word in _STATISTICS}
        summaries |= {i: cells[i] for i in rows}
    if 0 < len(summaries) < len(columns):
        columns.notes = (
            *columns.notes,
            "left out, because they are statistics of other lines: "
            + listed([f"line {columns.lines[i]} ({summaries[i]})" for i in sorted(summaries)]),
        )
        columns.keep([i for i in range(len(columns)) if i not in summaries])


def _is_statistic(word: str, others: Container[str]) -> bool:
    """Return whether this is the name of a statistic, or that of one and of another line."""
    parts = re.split(r" of |[ ()]+", word.strip("()"))
    return word in _STATISTICS or any(
        statistic in _STATISTICS and " ".join(other) in others
        for statistic, other in ((parts[0], parts[1:]), (parts[-1], parts[:-1]))
        if other
    )
