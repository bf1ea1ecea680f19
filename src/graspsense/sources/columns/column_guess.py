"""What the columns of an unknown table most likely are: time, gap and forces, from their names and their numbers.

A guess says whether the file states it, or whether a person has to check it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.sources.formats.table import ColumnTable, Numbers
from graspsense.sources.units import GRAM_FORCE, TO_SI, WITHOUT_UNIT, known_unit, unit_since_1970

TIME_WORDS: Final = frozenset((
    "t", "time", "times", "timestamp", "stamp", "stamps", "seconds", "sec", "elapsed", "clock",
))  # fmt: skip
GAP_WORDS: Final = frozenset((
    "gap", "width", "opening", "aperture", "pos", "position", "jpos", "travel", "displacement", "distance",
    "stroke", "spread", "extension",
))  # fmt: skip
FORCE_WORDS: Final = frozenset((
    "force", "forces", "load", "f", "n", "newton", "newtons", "pressure", "pdc", "fsr", "gram", "grams", "g",
    "weight", "eucl", "taxels", "taxel", "tactile", "biotac",
))  # fmt: skip
_LONGEST_STEP_S: Final = 0.25
"""The time between the samples of a grasp, where no unit is stated."""
_EVEN, _MOSTLY = 0.2, 0.9
"""Deviation of a step from the median, as a share of it, and the share of the steps that are within, for a time."""
EFFORT_WORDS: Final = frozenset(("effort", "eff", "torque", "current"))
FINGER_WORDS: Final = frozenset(("finger", "fingertip", "tip", "pad", "jaw"))
"""A column that is named after a finger alone is its force or its position; its numbers tell which."""
_FREE: Final = 0.1
"""Largest share of its peak that a force has in the first quarter of a recording, before the fingers touch."""
_SIDES: Final = (("left", "right"), ("l", "r"))
_FEWEST_CELLS: Final = 4
"""Numbered columns from which they are the cells of a sensor."""
_COUNTS: Final = 20.0
"""Whole numbers up to more than this are counts."""


@frozen(kw_only=True)
class Guess:
    """A line of a manifest: the key, its value, and what has to be checked (empty where the file states it)."""

    key: str
    value: str
    check: str = ""


def words_of(name: str) -> tuple[str, ...]:
    """Return the words in a name, in small letters.

    >>> words_of("Grip_forceLeft (N)"), words_of("F1pdc")
    (('grip', 'force', 'left', 'n'), ('f', 'pdc'))
    """
    return tuple(word.lower() for word in re.findall(r"[A-Z]?[a-z\u00b5]+|[A-Z]+(?![a-z])|#", name))


def _with_words(names: Iterable[str], words: Set[str]) -> list[str]:
    """Return the names in which one of these words stands."""
    return [name for name in names if words & set(words_of(name))]


def quoted(name: str) -> str:
    """Return a column as an expression names it."""
    return name if name.isidentifier() else f"'{name}'" if "'" not in name else f'"{name}"'


def guesses(table: ColumnTable) -> Iterator[Guess]:
    """Yield the lines of a manifest that describe the columns of a table."""
    time = time_column(table)
    forces = force_columns(table, time)
    gap = _gap_columns(table, (time, *forces))
    if time is not None:
        yield _time(table, time)
    elif table.t_s is None and len(table) > 1:
        yield Guess(key="rate_hz", value="100", check="no column is a time: write the rate of the samples")
    force = _mean(table, forces)
    if gap:
        yield _gap(table, gap, force)
    yield from _forces(table, forces)
    yield from _effort(table, force)
    yield from _channels(table)


def time_column(table: ColumnTable) -> str | None:
    """Return the column that is most likely the time, None if none increases."""
    rising = [name for name, values in table.numbers.items() if values.ndim == 1 and _rises(values)]
    named = _with_words(rising, TIME_WORDS)
    states = [name for name in rising if known_unit(table.units.get(name, ""), "time")]
    units = _with_words(rising, {"ms", "us", "ns", "sec"})
    return next(iter((*states, *named, *units, *_evenly_rising(table, rising))), None)


def _evenly_rising(table: ColumnTable, rising: Sequence[str]) -> list[str]:
    """Return the columns without a name that rise by nearly equal steps, those with fractions first; no counters."""
    candidates = []
    for name in rising:
        steps = np.diff(table.numbers[name])
        step = float(np.median(steps))
        even = bool(np.mean(np.abs(steps - step) <= _EVEN * step) > _MOSTLY) and step != 1.0
        if even and re.fullmatch(r"c\d+", name):
            candidates.append(name)
    return sorted(
        candidates, key=lambda name: bool((table.numbers[name] == np.round(table.numbers[name])).all())
    )


def force_columns(table: ColumnTable, time: str | None) -> tuple[str, ...]:
    """Return the columns that are most likely forces."""
    columns = [name for name in table.numbers if name != time]
    stated = [name for name in columns if _unit(table.units.get(name, ""), "force")]
    others = _with_words(columns, GAP_WORDS | {"torque"})
    named = [name for name in _with_words(columns, FORCE_WORDS) if name not in others]
    strong = _with_words(named, FORCE_WORDS - {"f", "n", "g"})
    return tuple(stated or strong or named or _forces_of_fingers(table, columns))


def _forces_of_fingers(table: ColumnTable, columns: Sequence[str]) -> list[str]:
    """Return the columns of both fingers if these are named by nothing else, and none moves before it is pressed."""
    named = _with_words(columns, FINGER_WORDS)
    fingers = [name for name in named if not known_unit(table.units.get(name, ""), "gap")]
    sided = any(_sided(fingers, pair) for pair in _SIDES)
    return fingers if sided and all(map(_rises_late, (table.numbers[name] for name in fingers))) else []


def _rises_late(values: Numbers) -> bool:
    """Return whether numbers are nearly zero in the first quarter and not later, as a force is."""
    known = np.abs(values[np.isfinite(values)])
    return len(known) >= 4 and float(known[: len(known) // 4].max()) < _FREE * float(known.max())


def numbered_groups(names: Sequence[str]) -> dict[str, list[str]]:
    """Return columns that differ in the number at their end, by the pattern that stands for them.

    >>> list(numbered_groups(["ff_1", "ff_2", "ff_3", "ff_4", "x"]))
    ['ff_*']
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(re.sub(r"\d+$", "*", name), []).append(name)
    return {pattern: group for pattern, group in groups.items() if len(group) >= _FEWEST_CELLS}


def _gap_columns(table: ColumnTable, taken: Sequence[str | None]) -> tuple[str, ...]:
    """Return the column that is most likely the gap, or several of one kind, as the positions of fingers."""
    columns = [name for name, values in table.numbers.items() if name not in taken and values.ndim == 1]
    stated = [name for name in columns if known_unit(table.units.get(name, ""), "gap")]
    named, units = _with_words(columns, GAP_WORDS), _with_words(columns, {"mm", "cm"})
    able = [name for name in (*stated, *named, *units) if np.nanstd(table.numbers[name]) > 0.0]
    gaps = able or named
    return tuple(name for name in dict.fromkeys(gaps) if words_of(name) == words_of(gaps[0]))


def _time(table: ColumnTable, name: str) -> Guess:
    values = table.numbers[name]
    stated = _stated(table, name, "time")
    if stated:
        return Guess(key="time", value=f"{quoted(name)} [{stated}]")
    step = float(np.median(np.diff(values)))
    if unit_since_1970(float(values[0])):  # which the reader tells
        return Guess(key="time", value=quoted(name))
    to_s = TO_SI["time"]
    unit = next((unit for unit in ("s", "ms", "us", "ns") if step * to_s[unit] <= _LONGEST_STEP_S), "s")
    rate_hz = 1.0 / (step * to_s[unit]) if step > 0.0 else math.nan
    return Guess(
        key="time",
        value=f"{quoted(name)} [{unit}]",
        check=f"no unit is stated: [{unit}] gives {rate_hz:.3g} Hz",
    )


def _gap(table: ColumnTable, names: Sequence[str], force: Numbers | None) -> Guess:
    values: Numbers = np.mean([table.numbers[name] for name in names], axis=0)
    unit, checks = _stated(table, names[0], "gap"), []
    if not unit:
        largest = float(np.nanmax(np.abs(values)))
        unit = "m" if largest <= 0.3 else "mm" if largest <= 300.0 else "counts"
        checks.append(f"no unit is stated, and the numbers reach {largest:.4g}")
    expression = quoted(names[0])
    if len(names) > 1:
        expression = f"mean({', '.join(map(quoted, names))})"
        checks.append(f"the mean of {len(names)} columns")
    if force is not None:
        moved = float(values[int(np.nanargmax(force))] - values[0])
        if moved > 0.2 * float(np.nanmax(values) - np.nanmin(values)):
            top = float(np.nanmax(values))
            top = math.ceil(top * 1e3) / 1e3 if unit == "m" else math.ceil(top)
            expression = f"{top:g} - {expression}"
            checks.append(f"the numbers grow while the force grows, so {top:g} is a nominal opening")
    return Guess(key="gap", value=f"{expression} [{unit}]", check="; ".join(checks))


def _effort(table: ColumnTable, force: Numbers | None) -> Iterator[Guess]:
    name = next(iter(_with_words(table.numbers, EFFORT_WORDS)), None)
    if name is None or force is None or table.numbers[name].ndim > 1:
        return
    values = table.numbers[name]
    opposed = float(np.nanmean((values - np.nanmean(values)) * (force - np.nanmean(force)))) < 0.0
    yield Guess(key="effort", value="-" * opposed + quoted(name), check="its unit and its sign")


def _channels(table: ColumnTable) -> Iterator[Guess]:
    """Yield a line for the arrays, which are kept as channels."""
    arrays = [name for name, values in table.numbers.items() if values.ndim == 2]
    named = {_channel_name(name) or "array": name for name in arrays}
    lines = [f'{key} = "{quoted(name)} [counts]"' for key, name in named.items() if key[0].isalpha()]
    if lines:
        yield Guess(key="channels", value=f"{{ {', '.join(lines)} }}", check="the units of the arrays")


def _channel_name(name: str) -> str:
    return re.sub("[^a-z0-9]+", "_", name.lower()).strip("_")


def _forces(table: ColumnTable, names: Sequence[str]) -> Iterator[Guess]:
    """Yield the force, or the left and the right one."""
    if not names:
        yield Guess(key="force", value="", check="no column is known to be a force: name it, with its unit")
        return
    cells = numbered_groups(names)
    if cells and sum(map(len, cells.values())) == len(names):
        yield from _forces_of_cells(table, cells)
        return
    sides = next(
        (pair_of_sides for pair in _SIDES if (pair_of_sides := _sided(names, pair)) is not None), None
    )
    several = table.numbers[names[0]].ndim == 2
    if sides is None and len(names) == 2:
        sides = (names[:1], names[1:])
        said = f"{names[0]} is taken for the left side, {names[1]} for the right"
    elif sides is None and len(names) > 2:
        sides = (names[:-1], names[-1:])
        said = f"{len(names)} forces: say which fingers are which side"
    else:
        said = ""
    if sides is None:
        yield _force(table, "force", names, "the sum of its numbers" if several else "")
        return
    for key, side in zip(("left", "right"), sides, strict=True):
        yield _force(table, key, side, said)


def _forces_of_cells(table: ColumnTable, cells: Mapping[str, Sequence[str]]) -> Iterator[Guess]:
    """Yield the forces of sensors with many cells, each a group of columns, and the channels that keep them."""
    names = [name for names in cells.values() for name in names]
    unit = _force(table, "force", names, "").value.rpartition(" ")[2]
    patterns = [f"'{pattern}'" for pattern in cells]
    said = f"{len(cells)} groups of cells: say which are which side"
    if len(patterns) == 1:
        yield Guess(key="force", value=f"mean({patterns[0]}) {unit}", check="the mean of its cells")
    else:
        yield Guess(key="left", value=f"mean({', '.join(patterns[:-1])}) {unit}", check=said)
        yield Guess(key="right", value=f"mean({patterns[-1]}) {unit}", check=said)
    named = ", ".join(f'{_channel_name(pattern)} = "{pattern} {unit}"' for pattern in patterns)
    yield Guess(key="channels", value=f"{{ {named} }}", check="the names of the groups")


def _sided(names: Sequence[str], pair: tuple[str, str]) -> tuple[Sequence[str], Sequence[str]] | None:
    left, right = ([name for name in names if side in words_of(name)] for side in pair)
    return (left, right) if left and right and len(left) + len(right) == len(names) else None


def _force(table: ColumnTable, key: str, names: Sequence[str], said: str) -> Guess:
    unit, checks = _stated(table, names[0], "force"), [said] if said else []
    values = np.concatenate([table.numbers[name].reshape(-1) for name in names])
    if not unit:
        whole = bool((values[np.isfinite(values)] == np.round(values[np.isfinite(values)])).all())
        unit = "counts" if whole and float(np.nanmax(np.abs(values))) > _COUNTS else "N"
        checks.append("whole numbers are taken for counts" if unit == "counts" else "no unit is stated")
    elif unit == "gf":
        checks.append("a mass is taken for gram-force")
    several = len(names) > 1 or table.numbers[names[0]].ndim == 2
    inside = ", ".join(map(quoted, names))
    fold = "sum" if table.numbers[names[0]].ndim == 2 else "max"
    return Guess(
        key=key, value=f"{f'{fold}({inside})' if several else inside} [{unit}]", check="; ".join(checks)
    )


def _mean(table: ColumnTable, names: Sequence[str]) -> Numbers | None:
    parts = [table.numbers[name].reshape(len(table), -1) for name in names]
    if not parts:
        return None
    mean: Numbers = np.column_stack(parts).mean(axis=1)
    return mean if np.isfinite(mean).any() else None


def _stated(table: ColumnTable, name: str, quantity: str) -> str:
    """Return the unit that a line of units or a name states, empty if neither does."""
    stated = table.units.get(name, "")
    own = stated if quantity != "time" and stated not in WITHOUT_UNIT else ""
    return _unit(stated, quantity) or own or unit_in_name(name, quantity)


def unit_in_name(name: str, quantity: str) -> str:
    """Return the unit of a quantity that a name ends with, such as `time_ms`; empty if it has none.

    >>> unit_in_name("time_ms", "time"), unit_in_name("F1_mN", "force"), unit_in_name("built_in", "gap")
    ('ms', 'mN', '')
    """
    words = [word for word in words_of(name) if len(name) > 1]
    parts = [*(words[1:] or words), *re.findall("[A-Za-z]+", name)[1:]]
    return next(filter(None, (_unit(word, quantity) for word in reversed(parts) if word != "in")), "")


def _unit(text: str, quantity: str) -> str:
    mass = GRAM_FORCE.get(text.lower(), "") if quantity == "force" else ""
    return known_unit(text, quantity) or mass


def _rises(values: Numbers) -> bool:
    """Return whether numbers increase, apart from a few that repeat or jump."""
    steps = np.diff(values[np.isfinite(values)])
    return len(steps) > 0 and float((steps > 0.0).mean()) > 0.5 and float((steps < 0.0).mean()) < 0.05
