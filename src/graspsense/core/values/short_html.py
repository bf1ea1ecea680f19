"""Lines and tables of short HTML, which takes its colours from the notebook that shows it."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape


def sentence(text: str, *, strong: bool = False) -> str:
    """Return a line of plain text."""
    return f"<div>{'<strong>' if strong else ''}{escape(text)}{'</strong>' if strong else ''}</div>"


def table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Return a table of plain texts."""
    head = "".join(f'<th style="text-align:left">{escape(cell)}</th>' for cell in header)
    body = "".join(
        "<tr>" + "".join(f'<td style="text-align:left">{escape(cell)}</td>' for cell in row) + "</tr>"
        for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
