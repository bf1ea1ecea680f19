"""The confusion matrix: for the terminal, as a picture, and as a table of a page."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from graspsense.report.html import wide
from graspsense.report.write import new_figure, write_picture

if TYPE_CHECKING:
    from graspsense.evaluation.results import Confusion


def confusion_text(confusion: Confusion) -> list[str]:
    """Return the matrix as lines of text: rows are true labels, columns predicted ones; letters stand for labels."""
    letters = [_letter(k) for k in range(len(confusion.labels))]
    width = max(len(str(n)) for row in confusion.counts for n in row)
    width = max(width, max(map(len, letters)))
    lines = [" ".join(letter.rjust(width) for letter in letters) + "   <- answered"]
    for letter, label, row in zip(letters, confusion.labels, confusion.counts, strict=True):
        cells = " ".join((str(n) if n else ".").rjust(width) for n in row)
        lines.append(f"{cells}   {letter} = {label}")
    return lines


def confusion_png(confusion: Confusion, title: str, path: Path) -> None:
    """Draw the matrix. Raises PluginUnavailable without matplotlib, ConfigError for a path that cannot be written."""
    n = len(confusion.labels)
    side = 2.6 + 0.42 * n
    figure = new_figure(side, side)
    axes: Any = figure.add_subplot()
    totals = [max(sum(row), 1) for row in confusion.counts]
    shares = [[count / total for count in row] for row, total in zip(confusion.counts, totals, strict=True)]
    axes.imshow(shares, cmap="Blues", vmin=0.0, vmax=1.0)
    for i, row in enumerate(confusion.counts):
        for j, count in enumerate(row):
            if count:
                colour = "white" if shares[i][j] > 0.5 else "black"
                axes.text(j, i, str(count), ha="center", va="center", color=colour, fontsize=8)
    axes.set_xticks(range(n), confusion.labels, rotation=90, fontsize=8)
    axes.set_yticks(range(n), confusion.labels, fontsize=8)
    axes.set_xlabel("answered")
    axes.set_ylabel("true")
    axes.set_title(title, fontsize=9)
    # The title may be wider than a small matrix: "tight" extends the picture to include it.
    write_picture(path, figure, bbox_inches="tight")


def _letter(k: int) -> str:
    return (chr(ord("a") + k // 26 - 1) if k >= 26 else "") + chr(ord("a") + k % 26)


def confusion_table(confusion: Confusion, caption: str) -> str:
    """Return the counts. Rows are true labels, columns predicted ones; correct predictions are framed."""
    head = "".join(f'<th scope="col"><span>{escape(label)}</span></th>' for label in confusion.labels)
    body = []
    for i, (label, row) in enumerate(zip(confusion.labels, confusion.counts, strict=True)):
        breakable = escape(label).replace(":", ":<wbr>").replace("_", "_<wbr>")
        total = sum(row) or 1
        cells = []
        for j, count in enumerate(row):
            share = count / total
            # The colours in `page.css` are numbered from 1 to 8.
            kinds = [*([f"q{math.ceil(8 * share)}"] if count else []), *(["right"] if i == j else [])]
            kind = f' class="{" ".join(kinds)}"' if kinds else ""
            cells.append(f"<td{kind}>{count if count else '·'}</td>")
        body.append(
            f'<tr><th scope="row">{breakable}</th>{"".join(cells)}'
            f'<td class="n">{100 * row[i] / total:.0f} %</td></tr>'
        )
    return wide(
        f"{caption} Rows are what it was, columns what it was taken for; right answers are framed, a stronger "
        "colour means more.",
        f'<table class="matrix"><thead><tr><td></td>{head}<th scope="col"><span>right</span></th></tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>",
    )
