"""One grasp from the CSV file of another program. The user says which columns are time, gap and force:

    FILE.csv?time=T&gap=POS*0.001&force=F1&force=F2&effort=I&velocity=V

Each value is the name of a column, followed by `*` and a factor if the column is not in SI units. `time`, `gap` and
`force` are required. A single `force` stands for both pads; two are left and right. Without `velocity`, the velocity is
the change of the gap from line to line.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from statistics import median
from typing import Final
from urllib.parse import parse_qsl, urlencode

from graspsense.core.errors import ConfigError, DataDamaged, suggestion
from graspsense.core.signals import NO_PADS, Frame, Reading
from graspsense.recording.replayable import Recording
from graspsense.sources.csv_columns import CsvColumns

REQUIRED: Final = ("time", "gap", "force")
QUANTITIES: Final = (*REQUIRED, "effort", "velocity")
PLAUSIBLE: Final = {
    "gap": (-0.05, 0.5, "m", "mm"),
    "force": (-2000.0, 2000.0, "N", "mN"),
    "effort": (-5000.0, 5000.0, "N", "mN"),
    "velocity": (-5.0, 5.0, "m/s", "mm/s"),
    "time between lines": (0.0, 1.0, "s", "ms"),
}
"""Quantity to its plausible range, the unit of that, and the unit that a column out of range is most likely in."""


def named(path: str, columns: Mapping[str, Sequence[str]]) -> str:
    """Return the file and its columns as one name, in the form that `read_squeeze` reads."""
    pairs = [(quantity, column) for quantity, names in columns.items() for column in names]
    return f"{path}?{urlencode(pairs, safe='*')}"


def read_squeeze(name: str) -> Recording:
    """Return the grasp that this name describes. Raises ConfigError, or DataDamaged with the line."""
    file, mark, query = name.rpartition("?")
    columns_of: dict[str, list[str]] = {}
    for quantity, column in parse_qsl(query, keep_blank_values=True) if mark else []:
        if quantity not in QUANTITIES:
            raise ConfigError(
                f"{quantity!r} is not a quantity of a grasp. Known: {', '.join(QUANTITIES)}."
                + suggestion(quantity, QUANTITIES)
            )
        columns_of.setdefault(quantity, []).append(column)
    missing = [quantity for quantity in REQUIRED if quantity not in columns_of]
    if missing:
        raise ConfigError(
            f"which column of {file or name} is {' and which '.join(missing)}? Write FILE.csv?time=COLUMN&gap=COLUMN"
            "&force=COLUMN, or give --time, --gap and --force to `import`. If a column is not in s, m or N, add a "
            "factor, as in POS*0.001"
        )
    for quantity, names in columns_of.items():
        allowed = 2 if quantity == "force" else 1
        if len(names) > allowed:
            raise ConfigError(f"{len(names)} columns are given for {quantity}; at most {allowed} can be")
    columns = CsvColumns(Path(file).expanduser())
    values = {
        quantity: [_column(columns, quantity, text) for text in names]
        for quantity, names in columns_of.items()
    }
    return _recording(columns, values)


def _column(columns: CsvColumns, quantity: str, text: str) -> list[float]:
    """Return the values of COLUMN or COLUMN*FACTOR. Raises ConfigError, DataDamaged."""
    name, star, factor_text = text.rpartition("*")
    factor = 1.0
    if star and text not in columns.cells:
        try:
            factor = float(factor_text)
        except ValueError:
            raise ConfigError(
                f"{quantity}: {factor_text!r} in {text!r} is not a factor: write COLUMN*0.001"
            ) from None
        if not math.isfinite(factor) or factor == 0.0:
            raise ConfigError(f"{quantity}: the factor {factor_text} must be finite and not 0")
    else:
        name = text
    columns.column(name, quantity)
    values = [factor * value for value in columns.numbers(name)]
    for line, value in zip(columns.lines, values, strict=True):
        if math.isnan(value):
            raise DataDamaged(f"{columns.path}, line {line}: {name} ({quantity}) is missing")
    return values


def _recording(columns: CsvColumns, values: Mapping[str, list[list[float]]]) -> Recording:
    (times,), (gaps,), forces = values["time"], values["gap"], values["force"]
    steps = _time_steps(columns, times)
    for quantity, found in values.items():
        if quantity != "time":
            _check_plausible(columns, quantity, [value for column in found for value in column])
    _check_plausible(columns, "time between lines", [median(steps)])
    if "velocity" in values:
        (velocities,) = values["velocity"]
    else:
        velocities = [0.0, *((b - a) / dt for (a, b), dt in zip(pairwise(gaps), steps[1:], strict=True))]
    (efforts,) = values.get("effort", [[math.nan] * len(times)])
    readings = tuple(
        Reading(Frame(t, dt, gap, velocity, effort, left, right, math.nan, math.nan, 0), NO_PADS)
        for t, dt, gap, velocity, effort, left, right in zip(
            times, steps, gaps, velocities, efforts, forces[0], forces[-1], strict=True
        )
    )
    notes = [f"{len(times)} lines of {columns.path.name}, read as s, m and N"]
    if len(forces) == 1:
        notes.append("a single force was recorded; it is used for both pads")
    return Recording(
        name=f"CSV {columns.path.name}", readings=readings, rate_hz=1.0 / median(steps), notes=tuple(notes)
    )


def _check_plausible(columns: CsvColumns, quantity: str, values: Sequence[float]) -> None:
    """Raise DataDamaged if a value is far from those of any gripper, as it is in another unit."""
    low, high, unit, other = PLAUSIBLE[quantity]
    extreme = max(values, key=lambda value: max(value - high, low - value))
    if not low <= extreme <= high:
        raise DataDamaged(
            f"{columns.path}: the {quantity} reaches {extreme:g} {unit}, which no gripper has. Plausible is {low:g} to "
            f"{high:g} {unit}. If the column is in {other}, write COLUMN*0.001"
        )


def _time_steps(columns: CsvColumns, times: Sequence[float]) -> list[float]:
    """Return the time between lines (s), that of the first line equal to the second's. Raises DataDamaged."""
    if len(times) < 2:
        raise DataDamaged(f"{columns.path} has a single line; a grasp needs at least two")
    for line, (before, after) in zip(columns.lines[1:], pairwise(times), strict=True):
        if after <= before:
            raise DataDamaged(
                f"{columns.path}, line {line}: the time goes from {before!r} to {after!r}; it must increase"
            )
    steps = [after - before for before, after in pairwise(times)]
    return [steps[0], *steps]
