"""Draws `docs/architecture.svg` from the imports in the source: which subpackage imports from which.

    python docs/package_drawing.py

A test compares the drawing with what this gives. An arrow points from a subpackage to one that it imports from. It is
left out if it follows from others: if A imports from B and C, and B imports from C, there is no arrow from A to C.
Imports for type checking only are not counted.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from functools import cache
from graphlib import TopologicalSorter
from html import escape
from itertools import pairwise
from pathlib import Path

from attrs import frozen

ROOT = Path(__file__).parents[1]
FILE = ROOT / "docs" / "architecture.svg"
HOST = "graspsense"
SIMULATOR = "graspsense_sim_gripper"
WIDTH = 860
ROW, BOX, GAP, MARGIN = 74, 30, 16, 20
LETTER = 7.4
"""Heights and distances, and the width of a letter, in pixels of the drawing."""
BEND = 16
"""How straight an arrow leaves and enters a box."""

PARTS = ("body", "handlers", "cases", "orelse", "finalbody")
"""Where a statement has others within it."""

Graph = dict[str, set[str]]
Place = tuple[float, float]


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


def _in_order(graph: Graph) -> list[str]:
    """Return the subpackages with those before each that it imports from. Raises CycleError, which tests exclude."""
    return list(TopologicalSorter(graph).static_order())


def reduced(graph: Graph) -> Graph:
    """Return the graph without the arrows that follow from others."""
    reached: Graph = {}
    for subpackage in _in_order(graph):
        reached[subpackage] = graph[subpackage].union(*(reached[used] for used in graph[subpackage]))
    return {
        subpackage: {used for used in targets if not any(used in reached[other] for other in targets)}
        for subpackage, targets in graph.items()
    }


def levels(graph: Graph) -> dict[str, int]:
    """Return the row of each subpackage, counted from the bottom: one above the highest that it imports from."""
    row_of: dict[str, int] = {}
    for subpackage in _in_order(graph):
        row_of[subpackage] = 1 + max((row_of[used] for used in graph[subpackage]), default=-1)
    return row_of


@frozen
class Panel:
    """One graph as drawn: rows from the top, arrows through free places of the rows between."""

    rows: tuple[tuple[str, ...], ...]
    arrows: tuple[tuple[str, ...], ...]
    """The places that an arrow goes through, from its subpackage to the one that it points to."""


def panel(graph: Graph) -> Panel:
    """Return where the subpackages of a graph are drawn."""
    arrows, row_of = [], levels(graph)
    rows: list[list[str]] = [[] for _ in range(max(row_of.values()) + 1)]
    for subpackage in sorted(graph):
        rows[row_of[subpackage]].append(subpackage)
    for subpackage, targets in sorted(reduced(graph).items()):
        for used in sorted(targets):
            between = [f"{subpackage}>{used}>{k}" for k in range(row_of[subpackage] - 1, row_of[used], -1)]
            for k, free in zip(range(row_of[subpackage] - 1, row_of[used], -1), between, strict=True):
                rows[k].append(free)
            arrows.append((subpackage, *between, used))
    pairs = [pair for arrow in arrows for pair in pairwise(arrow)]
    ordered = [tuple(row) for row in reversed(_ordered(rows, pairs))]
    return Panel(tuple(ordered), tuple(arrows))


def _ordered(rows: list[list[str]], pairs: list[tuple[str, str]]) -> list[list[str]]:
    """Return the rows with each subpackage near the mean place of its neighbours, which avoids crossings."""
    for sweep in range(24):
        order = range(1, len(rows)) if sweep % 2 == 0 else range(len(rows) - 2, -1, -1)
        for k in order:
            beside = rows[k - 1] if sweep % 2 == 0 else rows[k + 1]
            share = {name: (i + 0.5) / len(beside) for i, name in enumerate(beside)}
            means = {}
            for i, name in enumerate(rows[k]):
                near = [share[b] for a, b in pairs if a == name and b in share]
                near += [share[a] for a, b in pairs if b == name and a in share]
                means[name] = sum(near) / len(near) if near else (i + 0.5) / len(rows[k])
            rows[k] = sorted(rows[k], key=lambda name: (means[name], name))
    return rows


def drawing() -> str:
    """Return the drawing of the host, of its core and sources, and of the simulator as SVG."""
    parts: list[str] = []
    top = 0.0
    for title, graph in (
        ("graspsense and the distributions beside it", host_subpackages()),
        ("graspsense.core", rooms_of("core")),
        ("graspsense.sources", rooms_of("sources")),
        ("graspsense-sim-gripper", simulator_subpackages()),
    ):
        top = _draw(parts, panel(graph), title, top + 30)
    arrow = (
        '<marker id="tip" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="8" markerHeight="8" orient="auto">'
        '<path d="M0,0 L8,4 L0,8 z" fill="#5c5c5c"/></marker>'
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {top:.0f}" width="{WIDTH}" '
        f'height="{top:.0f}" role="img" font-family="sans-serif">\n'
        "<title>Packages of the source, and which imports from which</title>\n"
        f"<defs>{arrow}</defs>\n"
        f'<rect width="{WIDTH}" height="{top:.0f}" fill="#ffffff"/>\n' + "\n".join(parts) + "\n</svg>\n"
    )


def _draw(parts: list[str], drawn: Panel, title: str, top: float) -> float:
    """Add a panel below `top` to the parts; return where it ends."""
    parts.append(f'<text x="{MARGIN}" y="{top:.0f}" font-size="15" font-weight="600">{escape(title)}</text>')
    places: dict[str, Place] = {}
    for k, row in enumerate(drawn.rows):
        widths = [_width(name) for name in row]
        spare = (WIDTH - 2 * MARGIN - sum(widths)) / len(row)
        x = MARGIN + spare / 2
        for name, width in zip(row, widths, strict=True):
            places[name] = x + width / 2, top + 22 + k * ROW
            x += width + spare
    for arrow in drawn.arrows:
        parts.append(
            f'<path d="{_way([places[name] for name in arrow])}" fill="none" stroke="#5c5c5c" stroke-width="1.2" '
            'marker-end="url(#tip)"/>'
        )
    for name, (x, y) in places.items():
        if ">" not in name:
            width = _width(name)
            fill = "#fdf0dd" if "/" in name else "#e9eff6"
            parts.append(
                f'<rect x="{x - width / 2:.1f}" y="{y:.1f}" width="{width:.1f}" height="{BOX}" rx="4" fill="{fill}" '
                f'stroke="#5c5c5c"/><text x="{x:.1f}" y="{y + 20:.1f}" text-anchor="middle" '
                f'font-size="13">{escape(name)}</text>'
            )
    return top + 22 + (len(drawn.rows) - 1) * ROW + BOX + MARGIN


def _width(name: str) -> float:
    return 14.0 if ">" in name else LETTER * len(name) + GAP


def _way(places: list[Place]) -> str:
    """Return the path of an arrow, out of the bottom of its subpackage and into the top of the last."""
    (x0, y0), *between, (x1, y1) = places
    way, x, y = f"M{x0:.1f},{y0 + BOX:.1f}", x0, y0 + BOX
    for free_x, free_y in between:
        way += f" C{x:.1f},{y + BEND:.1f} {free_x:.1f},{free_y - BEND:.1f} {free_x:.1f},{free_y:.1f}"
        way += f" L{free_x:.1f},{free_y + BOX:.1f}"
        x, y = free_x, free_y + BOX
    return way + f" C{x:.1f},{y + BEND:.1f} {x1:.1f},{y1 - BEND:.1f} {x1:.1f},{y1:.1f}"


def main() -> None:
    """Write the drawing."""
    FILE.write_text(drawing(), encoding="utf-8")


if __name__ == "__main__":
    main()
