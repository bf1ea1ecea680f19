"""Draws `docs/architecture.svg` from the imports in the source: which subpackage imports from which.

    python docs/package_drawing.py

A test compares the drawing with what this gives. It is a dependency structure matrix (D. V. Steward, IEEE Trans. Eng.
Manage. EM-28 (1981) 71): a dot says that the subpackage of its row imports from that of its column. Each stands below
those that it imports from, so a dot above the diagonal would be a circle. Imports for type checking only are not
counted.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from html import escape
from pathlib import Path

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "architecture.svg"
HOST = "graspsense"
SIMULATOR = "graspsense_sim_gripper"
WIDTH, CELL, MARGIN = 860, 22, 20
NAMES = 190
"""The width of the names of the rows; all in pixels of the drawing."""

PARTS = ("body", "handlers", "cases", "orelse", "finalbody")
"""Where a statement has others within it."""

Graph = dict[str, set[str]]


def host_subpackages() -> Graph:
    """Return the subpackages of graspsense and the distributions beside it, each with those that it imports from."""
    graph = _imports_within(ROOT / "src" / HOST, HOST, leave_out={"__init__", "__main__"})
    for distributions in ("plugins/*", "examples/*"):
        sources = [path for folder in ROOT.glob(distributions) for path in folder.glob("src/**/*.py")]
        graph[distributions] = {
            subpackage for path in sorted(sources) for subpackage in _used(path, HOST)
        } & graph.keys()
    return graph


def rooms_of(package: str) -> Graph:
    """Return the rooms of `graspsense.core` or `graspsense.sources`, each with those that it imports from."""
    return _imports_within(ROOT / "src" / HOST / package, f"{HOST}.{package}", leave_out={"__init__"})


def simulator_subpackages() -> Graph:
    """Return the subpackages of the simulator, each with those that it imports from."""
    return _imports_within(
        ROOT / "plugins" / "sim_gripper" / "src" / SIMULATOR, SIMULATOR, leave_out={"__init__"}
    )


def _imports_within(package: Path, name: str, leave_out: set[str]) -> Graph:
    graph: Graph = {}
    # A lazy module's stub has the imports that it does when a name is first used.
    for path in sorted([*package.rglob("*.py"), *package.rglob("*.pyi")]):
        subpackage = path.relative_to(package).parts[0].partition(".")[0]
        if subpackage not in leave_out:
            graph.setdefault(subpackage, set()).update(_used(path, name))
    return {subpackage: (used & graph.keys()) - {subpackage} for subpackage, used in graph.items()}


def _used(path: Path, package: str) -> Iterator[str]:
    """Yield the subpackages of `package` that a file imports from, but for imports for type checking."""
    for module, names in _imports(path):
        if module == package:
            yield from names
        elif module.startswith(f"{package}."):
            yield module.removeprefix(f"{package}.").partition(".")[0]


@cache
def _imports(path: Path) -> tuple[tuple[str, tuple[str, ...]], ...]:
    """Return the modules that a file imports, each with the names that it imports from it."""
    imported: list[tuple[str, tuple[str, ...]]] = []
    for node in _statements(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            imported += [(alias.name, ()) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.module and node.level == 0:
            imported.append((node.module, tuple(alias.name for alias in node.names)))
    return tuple(imported)


def _statements(node: ast.AST) -> Iterator[ast.AST]:
    """Yield every statement below a node that is not for type checking only."""
    checking = isinstance(node, ast.If) and ast.unparse(node.test).endswith("TYPE_CHECKING")
    for part in PARTS[checking:]:
        inner = getattr(node, part, ())
        for statement in inner if isinstance(inner, list) else ():
            yield statement
            yield from _statements(statement)


def in_order(graph: Graph) -> list[str]:
    """Return the subpackages with those before each that it imports from. Raises CycleError, which tests exclude."""
    sorter, ordered = TopologicalSorter(graph), []
    sorter.prepare()
    while sorter.is_active():
        ready = sorted(sorter.get_ready())
        ordered += ready
        sorter.done(*ready)
    return ordered


def drawing() -> str:
    """Return the drawing of the host, of its core and sources, and of the simulator as SVG."""
    parts: list[str] = []
    top = 0
    for title, graph in (
        ("graspsense and the distributions beside it", host_subpackages()),
        ("graspsense.core", rooms_of("core")),
        ("graspsense.sources", rooms_of("sources")),
        ("graspsense-sim-gripper", simulator_subpackages()),
    ):
        top = _draw(parts, graph, title, top + 30)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top}" width="{WIDTH}" '
        f'height="{top}" role="img" font-family="sans-serif" font-size="13">\n'
        "<title>Packages of the source, and which imports from which</title>\n"
        f'<rect width="{WIDTH}" height="{top}" fill="#ffffff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _draw(parts: list[str], graph: Graph, title: str, top: int) -> int:
    """Add the matrix of a graph below `top` to the parts; return where it ends."""
    parts.append(f'<text x="{MARGIN}" y="{top}" font-size="15" font-weight="600">{escape(title)}</text>')
    names, left = in_order(graph), MARGIN + NAMES
    for k, name in enumerate(names):
        y = top + 14 + k * CELL
        parts.append(f'<text x="{left - 8}" y="{y + 15}" text-anchor="end">{escape(name)}</text>')
        for j, used in enumerate(names[: k + 1]):
            x = left + j * CELL
            fill = "#c9d6e4" if j == k else "#f4f6f8"
            parts.append(f'<rect x="{x}" y="{y}" width="{CELL - 2}" height="{CELL - 2}" fill="{fill}"/>')
            if used in graph[name]:
                middle = CELL / 2 - 1
                parts.append(f'<circle cx="{x + middle}" cy="{y + middle}" r="5" fill="#2f5d8a"/>')
        # The name of the column stands on the diagonal.
        parts.append(
            f'<text x="{left + (k + 1) * CELL + 4}" y="{y + 15}" fill="#5c5c5c">{escape(name)}</text>'
        )
    return top + 14 + len(names) * CELL + MARGIN


def main() -> None:
    """Write the drawing."""
    FILE.write_text(drawing(), encoding="utf-8")


if __name__ == "__main__":
    main()
