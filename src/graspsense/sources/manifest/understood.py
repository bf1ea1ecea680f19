"""What can be told of a file without a manifest: its channels, and the squeezes in the most likely force."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from attrs import frozen

from graspsense.core.values.errors import DataDamaged, listed
from graspsense.sources.columns.channel_facts import ChannelFacts, channel_facts
from graspsense.sources.columns.column_guess import force_columns, guesses, time_column
from graspsense.sources.formats.raw_tables import raw_tables
from graspsense.sources.formats.table import ColumnTable, Numbers
from graspsense.sources.manifest.steps import held_runs
from graspsense.sources.units import TO_SI, unit_since_1970


@frozen(kw_only=True, eq=False)
class UnderstoodFile:
    """The channels of a file, their courses (times in s, values), and begin and end of each squeeze (s)."""

    path: Path
    tables: int
    channels: tuple[ChannelFacts, ...]
    courses: dict[str, tuple[Numbers, Numbers]]
    squeezes: tuple[tuple[float, float], ...]
    force: str
    """The channel that the squeezes were found in, empty if none is known to be a force."""
    notes: tuple[str, ...]
    suggested: tuple[str, ...]
    """Lines of a manifest for it, most likely."""


def understood_file(path: Path) -> UnderstoodFile:
    """Return what can be told of a file. Raises ConfigError, TooLarge, DataDamaged."""
    tables = raw_tables(path)
    if not any(table.numbers for table in tables):
        texts = listed(
            [repr(name) for name in dict.fromkeys(name for table in tables for name in table.texts)]
        )
        raise DataDamaged(
            f"{path} has no column of numbers, as a recording has. Its columns are {texts or 'none'}"
        )
    topics = len({table.source for table in tables}) > 1 and tables[0].t_s is not None
    shown = tables if topics else tables[:1]
    timed = [(table, *_times(table)) for table in shown]
    ends = [t_s[-1] for _, t_s, known in timed if known and len(t_s)]
    channels, courses = [], {}
    for table, t_s, known in timed:
        for name, values in table.numbers.items():
            unit = table.units.get(name, "")
            channels.append(
                channel_facts(name, unit, values, t_s if known else None, max(ends, default=None))
            )
            courses[name] = (t_s, values if values.ndim == 1 else values.sum(axis=1))
    force, squeezed = _squeezes(timed)
    likely = [guess for table in shown for guess in guesses(table) if guess.value and guess.key != "rate_hz"]
    return UnderstoodFile(
        path=path,
        tables=len(tables),
        channels=tuple(channels),
        courses=courses,
        squeezes=squeezed,
        force=force,
        notes=tables[0].notes + tables[0].warnings,
        suggested=tuple(f'{guess.key} = "{guess.value}"' for guess in likely),
    )


def _times(table: ColumnTable) -> tuple[Numbers, bool]:
    """Return the times of the rows (s) and True, or their numbers and False if no time is known."""
    if table.t_s is not None:
        return table.t_s, True
    name = time_column(table)
    if name is None:
        return np.arange(len(table), dtype=np.float64), False
    guess = next(guess for guess in guesses(table) if guess.key == "time")
    unit = guess.value.rpartition("[")[2].rstrip("]") if guess.value.endswith("]") else ""
    values = table.numbers[name]
    return (values - values[0]) * TO_SI["time"].get(unit or unit_since_1970(float(values[0])), 1.0), True


def _squeezes(
    timed: Sequence[tuple[ColumnTable, Numbers, bool]],
) -> tuple[str, tuple[tuple[float, float], ...]]:
    """Return the most likely force, and begin and end of each time (s) at which an object is held."""
    for table, t_s, _ in timed:
        names = force_columns(table, time_column(table))
        if not names or len(t_s) < 2:
            continue
        parts = [np.abs(table.numbers[name]).reshape(len(table), -1).sum(axis=1) for name in names]
        force = np.sum(parts, axis=0)
        known = np.isfinite(force)  # a topic that was written to one table with others has rows of its own
        t_s, force = t_s[known], force[known]
        runs = held_runs(force, np.diff(t_s)) if len(t_s) > 1 else []
        return ", ".join(names), tuple((float(t_s[begin]), float(t_s[end - 1])) for begin, end in runs)
    return "", ()
