"""What the columns of an unknown table most likely are: time, gap and forces, from their names and their numbers.

A guess says whether the file states it, or whether a person has to check it.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Sequence, Set
from typing import Final

import numpy as np
from attrs import frozen

from graspsense.sources.columns.grasp_columns import is_channel_name
from graspsense.sources.formats.patterns import wildcard
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
    "force", "forces", "load", "f", "fx", "fy", "fz", "n", "newton", "newtons", "pressure", "pdc", "fsr", "gram",
    "grams", "g", "weight", "eucl", "taxels", "taxel", "tactile", "biotac",
))  # fmt: skip
_NOT_MEASURED: Final = frozenset((
    "error", "err", "target", "set", "setpoint", "desired", "des", "cmd", "command", "commanded", "reference", "ref",
    "goal", "requested", "limit", "threshold",
))  # fmt: skip
"""Words of what a controller asks for, or misses."""
_AXES: Final = frozenset("xyz")
"""Words of the coordinates of a tool, where a table has several."""
_LONGEST_STEP_S: Final = 0.25
"""The time between the samples of a grasp, where no unit is stated."""
_EVEN, _MOSTLY = 0.2, 0.9
"""Deviation of a step from the median, as a share of it, and the share of the steps that are within, for a time."""
EFFORT_WORDS: Final = frozenset(("effort", "eff", "torque", "current"))
FINGER_WORDS: Final = frozenset(("finger", "fingertip", "tip", "pad", "jaw"))
"""A column that is named after a finger alone is its force or its position; its numbers tell which."""
_UNLOADED: Final = 4
"""Samples at the beginning of a recording that are taken for those of free fingers."""
_FREE: Final = 0.1
"""Largest share of its peak that a force has before the fingers touch, and of its range that a gap is below 0."""
_SIDES: Final = (("left", "right"), ("l", "r"))
_FEWEST_CELLS: Final = 4
"""Numbered columns from which they are the cells of a sensor."""
_UNNAMED: Final = re.compile(r"c[0-9]+").fullmatch
"""A name that a reader gives to a column without one."""
_NUMBER: Final = re.compile(rf"((?:{'|'.join(FINGER_WORDS)})[_ .-]?[0-9]+(?=.*[0-9]))|[0-9]+", re.IGNORECASE)
"""A number in the name of a cell, but for that of its finger."""
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


def _measured(names: Iterable[str]) -> list[str]:
    """Return the names that are not those of a goal, or of how far from it something is."""
    return [name for name in names if not _NOT_MEASURED & set(words_of(name))]


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
    guessed = list(_forces(table, forces))
    yield from guessed
    yield from _effort(table, force)
    yield from _channels(table, forces, guessed[0].value.rpartition(" ")[2])


def time_column(table: ColumnTable) -> str | None:
    """Return the column that is most likely the time, None if none increases."""
    return next(iter(_time_columns(table)), None)


def _time_columns(table: ColumnTable) -> list[str]:
    """Return the columns that can be the time, the most likely one first."""
    rising = [name for name, values in table.numbers.items() if values.ndim == 1 and _rises(values)]
    named = _with_words(rising, TIME_WORDS)
    states = [name for name in rising if known_unit(table.units.get(name, ""), "time")]
    units = _with_words(rising, {"ms", "us", "ns", "sec"})
    return [*dict.fromkeys((*states, *named, *units))] or _evenly_rising(table, rising)


def _evenly_rising(table: ColumnTable, rising: Sequence[str]) -> list[str]:
    """Return the columns without a name that rise by nearly equal steps, those with fractions first; no counters."""
    steps = {name: np.diff(table.numbers[name]) for name in rising if _UNNAMED(name)}
    medians = {name: float(np.median(each)) for name, each in steps.items()}
    even = [
        name
        for name, step in medians.items()
        if step != 1.0 and np.mean(np.abs(steps[name] - step) <= _EVEN * step) > _MOSTLY
    ]
    return sorted(even, key=lambda name: not (table.numbers[name] % 1.0).any())


def force_columns(table: ColumnTable, time: str | None) -> tuple[str, ...]:
    """Return the columns that are most likely forces."""
    columns = [name for name in _measured(table.numbers) if name != time]
    stated = [name for name in columns if _unit(table.units.get(name, ""), "force")]
    others = _with_words(columns, GAP_WORDS | {"torque"})
    named = [name for name in _with_words(columns, FORCE_WORDS) if name not in others]
    strong = _with_words(named, FORCE_WORDS - {"f", "n", "g"})
    named = [
        name for name in named if words_of(name)[0] != "n" or len(words_of(name)) == 1
    ]  # no `n_contacts`
    return tuple(stated or strong or named or _unnamed_forces(table, columns))


def _unnamed_forces(table: ColumnTable, columns: Sequence[str]) -> list[str]:
    """Return the columns of both fingers, or else of cells, that no word names, if none moves before it is pressed."""
    named = _with_words(columns, FINGER_WORDS)
    fingers = [name for name in named if not known_unit(table.units.get(name, ""), "gap")]
    if any(_sided(fingers, pair) for pair in _SIDES) and all(_rises_late(table, [name]) for name in fingers):
        return fingers
    others = [
        name
        for name in columns
        if not (GAP_WORDS | EFFORT_WORDS) & set(words_of(name)) and not _UNNAMED(name)
    ]
    groups = [own for own in _numbered_groups(others) if _cells(table, own).shape[1] >= _FEWEST_CELLS]
    return [name for group in groups if _rises_late(table, group) for name in group]


def _cells(table: ColumnTable, names: Sequence[str]) -> Numbers:
    """Return the numbers of several columns and arrays beside each other, a row for each sample."""
    return np.column_stack([table.numbers[name].reshape(len(table), -1) for name in names])


def _rises_late(table: ColumnTable, names: Sequence[str]) -> bool:
    """Return whether numbers stay for most of the time in which they make half of their way, as a force does."""
    values = _cells(table, names)
    values = values[np.isfinite(values).all(axis=1)]
    if len(values) < _UNLOADED:
        return False
    away = np.abs(values - np.median(values[:_UNLOADED], axis=0)).mean(axis=1)
    away -= np.median(away[:_UNLOADED])
    rising = away[: int((away > 0.5 * away.max()).argmax())]
    return len(rising) > 0 and float((rising < _FREE * away.max()).mean()) > 0.5


def _numbered_groups(names: Sequence[str]) -> list[list[str]]:
    """Return columns in groups that differ in numbers only, each the cells of a sensor.

    >>> _numbered_groups(["ff_0_1", "ff_0_2", "finger1_t1", "finger1_t2", "finger2_t1"])
    [['ff_0_1', 'ff_0_2'], ['finger1_t1', 'finger1_t2'], ['finger2_t1']]
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(_cell_pattern(name), []).append(name)
    return list(groups.values())


def _cell_pattern(name: str) -> str:
    return _NUMBER.sub(lambda number: number[1] or "*", name)


def _together(table: ColumnTable, names: Sequence[str]) -> list[str]:
    """Return the columns as an expression names them: by patterns, where these stand for no others."""
    several = len(names) > 1 and "[" not in names[0]  # brackets would be a choice of signs
    for patterns in (map(_cell_pattern, names), (re.sub("[0-9]", "?", name) for name in names)):
        distinct = [*dict.fromkeys(patterns)] if several else []
        matched = {name for name in table.numbers if any(wildcard(p).fullmatch(name) for p in distinct)}
        if matched == set(names):
            return [quoted(pattern) for pattern in distinct]
    return [*map(quoted, names)]


def _gap_columns(table: ColumnTable, taken: Sequence[str | None]) -> tuple[str, ...]:
    """Return the column that is most likely the gap, or several of one kind, as the positions of fingers."""
    columns = [
        name for name in _measured(table.numbers) if name not in taken and table.numbers[name].ndim == 1
    ]
    along = _with_words(columns, _AXES)
    if len(along) > 1:  # where a tool is
        columns = [name for name in columns if name not in along]
    stated = [name for name in columns if known_unit(table.units.get(name, ""), "gap")]
    named, units = _with_words(columns, GAP_WORDS), _with_words(columns, {"mm", "cm"})
    able = [name for name in (*stated, *named, *units) if np.nanstd(table.numbers[name]) > 0.0]
    gaps = able or named
    return tuple(name for name in dict.fromkeys(gaps) if words_of(name) == words_of(gaps[0]))


def _time(table: ColumnTable, name: str) -> Guess:
    values = table.numbers[name]
    others = [quoted(other) for other in _time_columns(table) if other != name]
    checks = [f"{', '.join(others)} can be the time, too"] if others else []
    unit = _stated(table, name, "time")
    if not unit and not unit_since_1970(float(values[0])):  # which the reader tells
        step = float(np.median(np.diff(values)))
        to_s = TO_SI["time"]
        unit = next((unit for unit in ("s", "ms", "us", "ns") if step * to_s[unit] <= _LONGEST_STEP_S), "s")
        rate_hz = 1.0 / (step * to_s[unit]) if step > 0.0 else math.nan
        checks.append(f"no unit is stated: [{unit}] gives {rate_hz:.3g} Hz")
    return Guess(
        key="time", value=f"{quoted(name)} [{unit}]" if unit else quoted(name), check="; ".join(checks)
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
    if min(-np.nanmin(values), np.nanmax(values)) > _FREE * (np.nanmax(values) - np.nanmin(values)):
        checks.append("the numbers cross 0, and a gap does not")
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


def _channels(table: ColumnTable, forces: Sequence[str], unit: str) -> Iterator[Guess]:
    """Yield a line for the arrays and the cells of sensors, which are kept as channels."""
    columns = [([name], "[counts]") for name, values in table.numbers.items() if values.ndim == 2]
    columns += [(group, unit) for group in _numbered_groups(forces) if len(group) >= _FEWEST_CELLS]
    named = {}
    for group, its_unit in columns:
        key = re.sub("[^a-z0-9]+", "_", _cell_pattern(group[0]).lower()).strip("_") or "all"
        patterns = _together(table, group)
        key = key if is_channel_name(key) else f"cells_{key}"
        if len(patterns) == 1:
            named[key] = f'{key} = "{patterns[0]} {its_unit}"'
    if named:
        yield Guess(
            key="channels", value=f"{{ {', '.join(named.values())} }}", check="their names and their units"
        )


def _forces(table: ColumnTable, names: Sequence[str]) -> Iterator[Guess]:
    """Yield the force, or the left and the right one."""
    if not names:
        yield Guess(key="force", value="", check="no column is known to be a force: name it, with its unit")
        return
    groups = _numbered_groups(names)
    cells = all(len(group) >= _FEWEST_CELLS for group in groups)
    components = _components(names)
    groups = components or (groups if cells else [[name] for name in names])
    heads = [group[0] for group in groups]
    sides = next((sides for pair in _SIDES if (sides := _sided(heads, pair)) is not None), None)
    said = ""
    if sides is None and len(heads) > 1:
        sides = (heads[:-1], heads[-1:])
        said = f"{heads[0]} is taken for the left side, {heads[1]} for the right"
        if len(heads) > 2 or cells:
            said = f"{len(heads)} {'groups of cells' if cells else 'forces'}: say which are which side"
    if sides is None:
        array = table.numbers[names[0]].ndim == 2
        said = "the mean of its cells" if cells else "the sum of its numbers" if array else ""
    if components:
        said = f"the length of a force from its components; {said}".removesuffix("; ")
    for key, side in zip(("left", "right"), sides, strict=True) if sides else [("force", heads)]:
        own = [group for group in groups if group[0] in side]
        yield _force(table, key, own, said, components=bool(components))


def _components(names: Sequence[str]) -> list[list[str]]:
    """Return the columns that differ only in x, y and z, in groups of three: the components of a force.

    >>> _components(["Fx", "Fy", "Fz", "|Ft|"]), _components(["f1", "f2"])
    ([['Fx', 'Fy', 'Fz']], [])
    """
    groups: dict[str, list[str]] = {}
    for name in names:
        groups.setdefault(re.sub("[xyz]", "*", name, count=1, flags=re.IGNORECASE), []).append(name)
    return [group for key, group in groups.items() if len(group) == 3 and "*" in key]


def _sided(names: Sequence[str], pair: tuple[str, str]) -> tuple[Sequence[str], Sequence[str]] | None:
    left, right = ([name for name in names if side in words_of(name)] for side in pair)
    return (left, right) if left and right and len(left) + len(right) == len(names) else None


def _force(
    table: ColumnTable, key: str, groups: Sequence[Sequence[str]], said: str, *, components: bool
) -> Guess:
    """Return the force of single columns, or of groups of cells or of components."""
    names = [name for group in groups for name in group]
    unit, checks = _stated(table, names[0], "force"), [said] if said else []
    values = _cells(table, names)
    if not unit:
        whole = bool((values[np.isfinite(values)] == np.round(values[np.isfinite(values)])).all())
        unit = "counts" if whole and float(np.nanmax(np.abs(values))) > _COUNTS else "N"
        checks.append("whole numbers are taken for counts" if unit == "counts" else "no unit is stated")
    elif unit == "gf":
        checks.append("a mass is taken for gram-force")
    array, fold = table.numbers[names[0]].ndim == 2, "max" if len(groups[0]) == 1 else "mean"
    if components:
        parts, fold = [f"norm({', '.join(map(quoted, group))})" for group in groups], "max"
    else:
        parts = [name for group in groups for name in _together(table, group)]
    several = len(groups if components else names) > 1
    value = f"{'sum' if array else fold}({', '.join(parts)})" if array or several else parts[0]
    return Guess(key=key, value=f"{value} [{unit}]", check="; ".join(checks))


def _mean(table: ColumnTable, names: Sequence[str]) -> Numbers | None:
    mean: Numbers | None = _cells(table, names).mean(axis=1) if names else None
    return mean if mean is not None and np.isfinite(mean).any() else None


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
