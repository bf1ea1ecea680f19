"""Somebody else's squeeze from a CSV: which columns are time, gap and force, its user says.

    FILE.csv?time=T&gap=POS*0.001&force=F1&force=F2&effort=I&velocity=V

Each is the name of a column, with a factor behind `*` where it is not in SI units. `time`, `gap` and `force` there
must be; one `force` is that of both pads, two are left and right. Without a velocity it is the gap's difference from
line to line.
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
from graspsense.core.roles import Reading
from graspsense.core.signals import NO_PADS, Frame
from graspsense.recording.replayable import Recording
from graspsense.sources.features_csv import CsvColumns

NEEDED: Final = ("time", "gap", "force")
KNOWN: Final = (*NEEDED, "effort", "velocity")
FARTHEST_M: Final = 1.0
"""A gap that is wider is not in metres."""


def named(path: str, columns: Mapping[str, Sequence[str]]) -> str:
    """Return file and columns as one name, as `read_squeeze` takes it."""
    pairs = [(what, one) for what, names in columns.items() for one in names]
    return f"{path}?{urlencode(pairs, safe='*')}"


def read_squeeze(name: str) -> Recording:
    """Return the squeeze that this name says. Raises ConfigError, DataDamaged with the line."""
    file, mark, query = name.rpartition("?")
    pairs = parse_qsl(query, keep_blank_values=True) if mark else []
    given: dict[str, list[str]] = {}
    for what, column in pairs:
        if what not in KNOWN:
            raise ConfigError(
                f"{what!r} is no part of a squeeze. Known: {', '.join(KNOWN)}.{suggestion(what, KNOWN)}"
            )
        given.setdefault(what, []).append(column)
    lacking = [what for what in NEEDED if what not in given]
    if lacking:
        raise ConfigError(
            f"which column of {file or name} is {' and which '.join(lacking)}? Write FILE.csv?time=COLUMN&gap=COLUMN"
            "&force=COLUMN, to `import` --time, --gap and --force; with a factor, as in POS*0.001, where it is not in "
            "s, m, N"
        )
    for what, names in given.items():
        most = 2 if what == "force" else 1
        if len(names) > most:
            raise ConfigError(f"{len(names)} columns are given for {what}: {most} at most")
    columns = CsvColumns(Path(file).expanduser())
    found = {what: [_column(columns, what, one) for one in names] for what, names in given.items()}
    return _recording(columns, found)


def _column(columns: CsvColumns, what: str, text: str) -> list[float]:
    name, star, factor_text = text.rpartition("*")
    factor = 1.0
    if star and text not in columns.cells:
        try:
            factor = float(factor_text)
        except ValueError:
            raise ConfigError(
                f"{what}: {factor_text!r} in {text!r} is no factor: write COLUMN*0.001"
            ) from None
        if not math.isfinite(factor) or factor == 0.0:
            raise ConfigError(f"{what}: {factor_text} is no factor")
    else:
        name = text
    columns.column(name, what)
    values = [factor * value for value in columns.numbers(name)]
    for line, value in zip(columns.lines, values, strict=True):
        if math.isnan(value):
            raise DataDamaged(f"{columns.path}, line {line}: {name} ({what}) is missing")
    return values


def _recording(columns: CsvColumns, found: Mapping[str, list[list[float]]]) -> Recording:
    (times,), (gaps,), forces = found["time"], found["gap"], found["force"]
    if len(times) < 2:
        raise DataDamaged(f"{columns.path} has one line only: a squeeze needs more")
    for line, (before, now) in zip(columns.lines[1:], pairwise(times), strict=True):
        if now <= before:
            raise DataDamaged(
                f"{columns.path}, line {line}: the time goes from {before!r} to {now!r}: it must rise"
            )
    steps = [now - before for before, now in pairwise(times)]
    steps.insert(0, steps[0])
    if max(gaps) > FARTHEST_M:
        raise DataDamaged(
            f"{columns.path}: the gap goes up to {max(gaps):g} m, which no gripper has: where the column is in "
            "mm, write COLUMN*0.001 for it"
        )
    if "velocity" in found:
        (speeds,) = found["velocity"]
    else:
        speeds = [0.0, *((b - a) / dt for (a, b), dt in zip(pairwise(gaps), steps[1:], strict=True))]
    nothing = [math.nan] * len(times)
    (efforts,) = found.get("effort", [nothing])
    left, right = forces[0], forces[-1]
    readings = tuple(
        Reading(Frame(t, dt, gap, speed, effort, one, other, math.nan, math.nan, 0), NO_PADS)
        for t, dt, gap, speed, effort, one, other in zip(
            times, steps, gaps, speeds, efforts, left, right, strict=True
        )
    )
    notes = [f"{len(times)} lines of {columns.path.name}: taken to be in s, m and N"]
    if len(forces) == 1:
        notes.append("one force was recorded: it is taken for that of both pads")
    return Recording(
        name=f"CSV {columns.path.name}", readings=readings, rate_hz=1.0 / median(steps), notes=tuple(notes)
    )
