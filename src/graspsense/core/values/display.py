"""How values are drawn: by another package, so that a value imports no drawing."""

from __future__ import annotations

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
