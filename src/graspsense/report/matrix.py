"""A confusion matrix as an HTML table. A stronger colour means a larger share."""

from __future__ import annotations

import math
from html import escape
from typing import TYPE_CHECKING

from graspsense.report.html import wide

if TYPE_CHECKING:
    from graspsense.evaluation.results import Confusion


def confusion_table(confusion: Confusion, caption: str) -> str:
    """Return the counts. Rows are true labels, columns predicted ones; correct predictions are framed."""
    head = "".join(f'<th scope="col"><span>{escape(label)}</span></th>' for label in confusion.labels)
    body = []
    for i, (label, row) in enumerate(zip(confusion.labels, confusion.counts, strict=True)):
        total = sum(row) or 1
        cells = []
        for j, count in enumerate(row):
            share = count / total
            kinds = [*([f"q{_shade(share)}"] if count else []), *(["right"] if i == j else [])]
            kind = f' class="{" ".join(kinds)}"' if kinds else ""
            cells.append(f"<td{kind}>{count if count else '·'}</td>")
        body.append(
            f'<tr><th scope="row">{escape(label)}</th>{"".join(cells)}'
            f'<td class="n">{100 * row[i] / total:.0f} %</td></tr>'
        )
    return wide(
        f"{caption} Rows are what it was, columns what it was taken for; right answers are framed, a stronger "
        "colour means more.",
        f'<table class="matrix"><thead><tr><td></td>{head}<th scope="col"><span>right</span></th></tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>",
    )


def _shade(share: float) -> int:
    """Return the number of the colour in `page.css` for a share above 0: 1 to 8."""
    return min(max(math.ceil(8 * share), 1), 8)
