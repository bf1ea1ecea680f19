"""What the names of a LeRobot data set mean: the opening of a gripper, its load, and the cells of fingertips."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from attrs import field, frozen

AXES: Final = "xyz"
CELL: Final = re.compile(
    r"(?P<finger>[A-Za-z][\w.-]{0,60}?)[._]"
    r"(?:r(?:ow)?(?P<row>\d{1,4})[._]?c(?:ol)?(?P<column>\d{1,4})|(?:p|t|taxel|cell|pad|point)_?(?P<cell>\d{1,5}))"
    r"(?:[._]f?(?P<axis>[xyz]))?"
)
"""`f0.p00.fx`: finger, cell and axis; also `left_taxel_3`, and `thumb.r02c05` with row and column."""
GAP: Final = re.compile(
    r"(?:.*[._])?(?:gripper|gap|jaw)(?:[._](?:pos|position|width|opening|gap))?(?:[._]0)?"
)
EFFORT: Final = tuple(
    re.compile(rf"(?:.*[._])?(?:gripper|jaw)[._]{word}")
    for word in ("force", "effort", "torque", "load", "current")
)
"""What the motor of the gripper tells of its load, the best first."""
FORCE: Final = re.compile(
    r"(?:.*[._])?(?P<finger>f\d+|left|right|thumb|index|finger_?\d+)[._](?:force|pressure)(?:[._]n)?"
)


@frozen(kw_only=True)
class CellArray:
    """A tactile array whose cells are named numbers.

    `numbers` are the names of its cells, those of one cell after the other; `normal` are those that press on it.
    """

    name: str
    rows: int
    columns: int
    axes: str
    numbers: tuple[str, ...]

    @property
    def normal(self) -> tuple[str, ...]:
        """The names of the numbers along z, or of all where a cell has a single number."""
        return self.numbers[self.axes.index("z") :: len(self.axes)] if "z" in self.axes else self.numbers


@frozen(kw_only=True)
class Meaning:
    """What was understood of the names: the name of the gap, of the load, of forces, arrays, and the other names."""

    gap: tuple[str, ...] = ()
    effort: tuple[str, ...] = ()
    forces: tuple[str, ...] = ()
    arrays: tuple[CellArray, ...] = ()
    others: tuple[str, ...] = field(default=())


def meaning_of(names: Iterable[str]) -> Meaning:
    """Return what these names mean; those of several candidates come first that tell more."""
    every = list(names)
    arrays = _arrays(every)
    cells = {name for one in arrays for name in one.numbers}
    scalars = [name for name in every if name not in cells]
    lower = {name: name.lower() for name in scalars}
    gap = tuple(name for name in scalars if GAP.fullmatch(lower[name]))
    effort = tuple(name for pattern in EFFORT for name in scalars if pattern.fullmatch(lower[name]))
    forces = tuple(name for name in scalars if FORCE.fullmatch(lower[name]) and name not in effort)
    known = {*gap, *effort, *forces}
    return Meaning(
        gap=gap,
        effort=effort,
        forces=forces,
        arrays=arrays,
        others=tuple(name for name in scalars if name not in known),
    )


def channel_name(text: str) -> str:
    """Return a name that a channel can have.

    >>> channel_name("observation.tactile.Left-Pad")
    'tactile_left_pad'
    """
    word = re.sub(
        r"[^a-z0-9_]+", "_", text.lower().removeprefix("observation.").removeprefix("state.")
    ).strip("_")
    return word if word[:1].isalpha() else f"finger_{word}"


def _arrays(names: Sequence[str]) -> tuple[CellArray, ...]:
    """Return the arrays of at least two cells whose numbers are all there."""
    found: dict[str, dict[tuple[int, int, str], str]] = {}
    for name in names:
        match = CELL.fullmatch(name)
        if match:
            place = (int(match["row"] or 0), int(match["cell"] or match["column"]), match["axis"] or "")
            found.setdefault(match["finger"], {})[place] = name
    arrays = (_array(finger, cells) for finger, cells in found.items())
    return tuple(one for one in arrays if one is not None)


def _array(finger: str, cells: Mapping[tuple[int, int, str], str]) -> CellArray | None:
    rows = sorted({row for row, _, _ in cells})
    columns = sorted({column for _, column, _ in cells})
    axes = "".join(sorted({axis for _, _, axis in cells}))
    places = [(row, column, axis) for row in rows for column in columns for axis in axes or ("",)]
    if len(rows) * len(columns) < 2 or set(places) != set(cells):
        return None
    return CellArray(
        name=channel_name(finger),
        rows=len(rows),
        columns=len(columns),
        axes=axes or "z",
        numbers=tuple(cells[place] for place in places),
    )
