"""A public class name stands for one thing in the whole project, so that a reader of one package knows it in all."""

from __future__ import annotations

import ast
from collections import defaultdict
from pathlib import Path

from sources import parsed, statements

ROOT = Path(__file__).parents[1]


def public_classes() -> dict[str, list[str]]:
    """Return the files that define each public class, by its name."""
    files: dict[str, list[str]] = defaultdict(list)
    for folder in (ROOT / "src", *(ROOT / "plugins").glob("*/src"), *(ROOT / "examples").glob("*/src")):
        for path in sorted(folder.rglob("*.py")):
            for node in statements(parsed(path)):
                if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                    files[node.name].append(str(path.relative_to(ROOT)))
    return files


def test_no_public_class_name_stands_for_two_things():
    assert {name: files for name, files in public_classes().items() if len(files) > 1} == {}
