"""What the names of a LeRobot data set mean: the opening of a gripper, its load, and the cells of fingertips."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Final

from attrs import field, frozen

AXES: Final = "xyz"
_AXIS: Final = r"(?:f|force)?_?(?P<{}>[xyz])"
CELL: Final = re.compile(
    r"(?P<finger>[A-Za-z][\w.-]{0,60}?)[._]"
    rf"(?:{_AXIS.format('before')}[._])?"
    r"(?:r(?:ow)?_?(?P<row>\d{1,4})[._]?c(?:ol)?_?(?P<column>\d{1,4})"
    r"|(?P<kind>(?:p|t|taxel|cell|pad|point|sensor)_?)?(?P<cell>\d{1,5}))"
    rf"(?:[._]{_AXIS.format('after')})?(?:[._]n)?",
    re.IGNORECASE,
)
"""`f0.p00.fx`: finger, cell and axis; also `left_taxel_3`, and `thumb.r02c05` with row and column."""
TOUCH: Final = re.compile("tactile|taxel|touch|skin", re.IGNORECASE)
"""What is in a name of touch: a bare number behind it is that of a cell, and elsewhere that of a joint."""
GAP: Final = re.compile(
    r"(?P<arm>.*?)(?<![a-z0-9])(?:gripper|gap|jaw)"
    r"(?:[._](?:q?pos|position|width|opening|openness|gap|state|distance|joint))?(?:[._]0)?(?:[._](?P<unit>mm|cm|m|rad|deg))?"
)
EFFORT: Final = tuple(
    re.compile(rf"(?:.*[._])?(?:gripper|jaw)[._](?:\w+[._])?{word}(?:[._]n)?")
    for word in ("force", "effort", "torque", "load", "current")
)
"""What the motor of the gripper tells of its load, the best first."""
_SIDE: Final = r"f\d+|left|right|thumb|index|finger_?\d+|(?:left|right)_finger"
FORCE: Final = re.compile(
    rf"(?:.*[._])?(?:(?:{_SIDE})[._](?:force|pressure|fz)|(?:force|pressure)[._](?:{_SIDE}))(?:[._]n)?"
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

    def felt_by(self, *, has_arrays: bool) -> tuple[str, ...]:
        """Return the names of the force of each side, by the load of the motor where nothing else feels."""
        return self.forces or (() if has_arrays else self.effort[:1])


def meaning_of(names: Iterable[str], gap: str = "", force: str = "") -> Meaning:
    """Return what these names mean; those of several candidates come first that tell more.

    `gap` and `force` (names with commas between) take the place of what is found. Of several arms, forces and arrays
    are those of the arm of the gap.
    """
    every = list(names)
    grippers = {name: match["arm"] for name in every if (match := GAP.fullmatch(name.lower()))}
    chosen = tuple(dict.fromkeys((*((gap,) if gap else ()), *grippers)))
    arm = grippers.get(chosen[0], "") if chosen else ""
    # A gripper without a name in front of it is the only one.
    foreign = (
        tuple(gripper for gripper in grippers.values() if gripper != arm)
        if arm and all(grippers.values())
        else ()
    )
    own = [name for name in every if not name.lower().startswith(foreign)]
    arrays = _arrays(own)
    cells = {name for array in arrays for name in array.numbers}
    lower = {name: name.lower() for name in own if name not in cells and name not in grippers}
    given = tuple(name.strip() for name in force.split(",") if name.strip())
    effort = tuple(
        dict.fromkeys(name for pattern in EFFORT for name in lower if pattern.fullmatch(lower[name]))
    )
    forces = given or tuple(name for name in lower if FORCE.fullmatch(lower[name]) and name not in effort)
    known = {*chosen, *effort, *forces, *cells}
    return Meaning(
        gap=chosen,
        effort=effort,
        forces=forces,
        arrays=arrays,
        others=tuple(name for name in every if name not in known),
    )


def unit_of_name(gap: str) -> str:
    """Return the unit at the end of the name of a gap; empty if there is none.

    >>> unit_of_name("gripper_width_mm"), unit_of_name("gripper.pos")
    ('mm', '')
    """
    match = GAP.fullmatch(gap.lower())
    return (match["unit"] or "") if match else ""


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
    cells_by_finger: dict[str, dict[tuple[int, int, str], str]] = {}
    for name in names:
        match = CELL.fullmatch(name)
        if match and (match["row"] or match["kind"] or TOUCH.search(match["finger"])):
            axis = (match["after"] or match["before"] or "").lower()
            place = (int(match["row"] or 0), int(match["cell"] or match["column"]), axis)
            cells_by_finger.setdefault(match["finger"], {})[place] = name
    arrays = (_array(finger, cells) for finger, cells in cells_by_finger.items())
    return tuple(array for array in arrays if array is not None)


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
