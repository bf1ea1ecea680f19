"""The source files of the project as syntax trees; each is parsed once in a process."""

from __future__ import annotations

import ast
import gc
from collections.abc import Iterator
from functools import cache
from pathlib import Path

from graspsense.core.control.garbage_collection import no_collection


@cache
def parsed(path: Path) -> ast.Module:
    with no_collection():
        tree = ast.parse(path.read_text(encoding="utf-8"))
    gc.freeze()  # millions of nodes that stay: each later search for cycles took seconds
    return tree


def statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield every statement below a node, at whatever depth; expressions, which hold none, are not searched."""
    for part in ("body", "handlers", "cases", "orelse", "finalbody"):
        inner = getattr(node, part, ())
        # In a lambda and in `a if b else c`, which are expressions, they are no lists.
        for child in inner if isinstance(inner, list) else ():
            yield child
            yield from statements(child)
