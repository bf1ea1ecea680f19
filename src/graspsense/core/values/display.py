"""How values are drawn. Another package draws them, so that a value imports no drawing.

Lines and tables are short HTML, which takes its colours from the notebook that shows it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from html import escape
from importlib import import_module
from typing import Any

_drawn_by: list[str] = []


def drawn_by(module: str) -> None:
    """Name the module that draws: its functions `html(value)` and `plot(trace)` are imported when they are needed."""
    _drawn_by[:] = [module]


def html(value: object) -> str:
    """Return a value as a notebook shows it."""
    shown: str = import_module(_drawn_by[0]).html(value)
    return shown


def plot(trace: object) -> tuple[Any, Any]:
    """Draw a trace and return the axes of matplotlib."""
    axes: tuple[Any, Any] = import_module(_drawn_by[0]).plot(trace)
    return axes


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
