"""Lines of a table that are the mean, the sum or another statistic of its trials."""

from __future__ import annotations

from collections import Counter
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

    In the last lines, each has the name of a statistic that its column has nowhere else; an object of that name has
    several trials. Anywhere, the name stands in a column of numbers, as that of a trial.
    """
    summaries: dict[int, str] = {}
    for name, cells in columns.cells.items():
        words = [
            " ".join(cell.casefold().replace("_", " ").replace(".", " ").split()).strip(": ")
            for cell in cells
        ]
        rows = [i for i, word in enumerate(words) if word in _STATISTICS]
        if not rows:
            continue
        times = Counter(words)
        last = len(cells)
        while last and words[last - 1] in _STATISTICS and times[words[last - 1]] == 1:
            last -= 1
        numbered = columns.has_numbers(name)
        summaries |= {i: cells[i] for i in rows if numbered or i >= last}
    if 0 < len(summaries) < len(columns):
        columns.notes = (
            *columns.notes,
            "left out, because they are statistics of other lines: "
            + listed([f"line {columns.lines[i]} ({summaries[i]})" for i in sorted(summaries)]),
        )
        columns.keep([i for i in range(len(columns)) if i not in summaries])
