"""A public class name stands for one thing in the whole project, so that a reader of one package knows it in all."""

from __future__ import annotations

import ast
import re
from collections import Counter, defaultdict
from itertools import chain

from repository import ROOT
from source_code import parsed, statements


def repeated_public_classes():
    """Return the files that define a public class, once for each definition, by the names that have several."""
    folders = (ROOT / "src", *(ROOT / "plugins").glob("*/src"), *(ROOT / "examples").glob("*/src"))
    paths = [path for folder in folders for path in sorted(folder.rglob("*.py"))]
    # Parsing all takes seconds. Only a name that follows the word twice can be defined twice.
    named = {path: re.findall(r"\bclass\s+(\w+)", path.read_text(encoding="utf-8")) for path in paths}
    several = {name for name, count in Counter(chain.from_iterable(named.values())).items() if count > 1}
    files: dict[str, list[str]] = defaultdict(list)
    for path in paths:
        for node in statements(parsed(path)) if several & set(named[path]) else ():
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                files[node.name].append(str(path.relative_to(ROOT)))
    return {name: where for name, where in files.items() if len(where) > 1}


def test_no_public_class_name_stands_for_two_things():
    assert repeated_public_classes() == {}
