"""The lines of a package that import a name from `graspsense.plugin_api` that it no longer has."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from graspsense.core.components.moved_names import new_form

_MODULE: Final = "graspsense.plugin_api"


def old_imports(path: Path) -> Iterator[str]:
    """Yield each use of a moved name in a source file: its place, the old form, and the new form beside it."""
    try:
        tree = ast.parse(path.read_bytes())
    except SyntaxError:
        return
    for line, name, old in sorted(_uses(tree)):
        if replacement := new_form(name):
            yield f"{path}:{line}: {old} -> {replacement}"


def _uses(tree: ast.Module) -> Iterator[tuple[int, str, str]]:
    """Yield line, name and text of everything that is taken from the module."""
    called = {_MODULE}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == _MODULE:
            for alias in node.names:
                yield alias.lineno, alias.name, f"from {_MODULE} import {alias.name}"
        elif isinstance(node, ast.ImportFrom) and node.module == "graspsense":
            called |= {alias.asname or alias.name for alias in node.names if alias.name == "plugin_api"}
        elif isinstance(node, ast.Import):
            called |= {alias.asname for alias in node.names if alias.name == _MODULE and alias.asname}
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and ast.unparse(node.value) in called:
            yield node.lineno, node.attr, ast.unparse(node)
