"""A confusion matrix as a table that can be read, in which darker means more."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING

from graspsense.report.html import wide

if TYPE_CHECKING:
    from graspsense.evaluation.confusion import Confusion


def confusion_table(confusion: Confusion, caption: str) -> str:
    """Return the counts; a row is what it was, a column what it was taken for, right answers are framed."""
    head = "".join(f'<th scope="col"><span>{escape(label)}</span></th>' for label in confusion.labels)
    body = []
    for i, (label, row) in enumerate(zip(confusion.labels, confusion.counts, strict=True)):
        total = sum(row) or 1
        cells = []
        for j, count in enumerate(row):
            share = count / total
            paint = f' style="background:{_shade(share)};color:{"#fff" if share > 0.5 else "#1a1a1a"}"'
            frame = ' class="right"' if i == j else ""
            cells.append(f"<td{frame}{paint if count else ''}>{count if count else '·'}</td>")
        body.append(
            f'<tr><th scope="row">{escape(label)}</th>{"".join(cells)}'
            f'<td class="n">{100 * row[i] / total:.0f} %</td></tr>'
        )
    return wide(
        f"{caption} Rows are what it was, columns what it was taken for; right answers are framed, darker is more.",
        f'<table class="matrix"><thead><tr><td></td>{head}<th scope="col"><span>right</span></th></tr></thead>'
        f"<tbody>{''.join(body)}</tbody></table>",
    )


def _shade(share: float) -> str:
    """Return a blue, from nearly white to dark; at half, where the text turns white, it is dark enough for that."""
    share = min(max(share, 0.0), 1.0)
    light, dark = ((238, 244, 250), (150, 190, 225)) if share <= 0.5 else ((45, 105, 160), (8, 60, 110))
    part = 2 * share if share <= 0.5 else 2 * share - 1
    return "#" + "".join(f"{round(a + (b - a) * part):02x}" for a, b in zip(light, dark, strict=True))
