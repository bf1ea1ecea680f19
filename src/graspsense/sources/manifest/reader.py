"""Recordings that a manifest describes: `manifest:FILE.toml`."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from itertools import islice, pairwise
from pathlib import Path
from typing import Any

import numpy as np
from attrs import evolve

from graspsense.core.values.errors import ConfigError, DataDamaged, counted, listed
from graspsense.core.values.label_text import is_missing_label
from graspsense.core.values.limits import RECORDINGS
from graspsense.core.values.written_times import seconds_since_first
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.grasp_columns import GraspColumns, checked_recording
from graspsense.sources.formats.raw_tables import raw_tables
from graspsense.sources.formats.table import ColumnTable, Numbers, TableRules
from graspsense.sources.formats.topic_clocks import Messages, common_clock
from graspsense.sources.manifest.alike import MOST_COMPARED, compared
from graspsense.sources.manifest.description import ReadManifest, axes_of, read_manifest, texts_of
from graspsense.sources.manifest.facts import (
    filled,
    instance_of,
    label_of,
    order_of,
    recorded_at_of,
    values_of,
)
from graspsense.sources.manifest.files import FIELD, NamedFile, beside, files_of, left_out
from graspsense.sources.manifest.notices import falls_on_closing, notices_of
from graspsense.sources.manifest.samples import samples
from graspsense.sources.manifest.steps import cut_at, resampled, squeezes
from graspsense.sources.units import TO_SI, unit_since_1970


def read_recordings(place: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every grasp of a manifest with its label, or why a file or a part of it cannot be read.

    Raises ConfigError if the manifest itself cannot be used.
    """
    manifest = read_manifest(Path(os.path.expanduser(place)))
    told = list(left_out(manifest))
    for file in files_of(manifest):
        grasps = _recordings_of(manifest, file, told)
        while together := list(islice(grasps, MOST_COMPARED)):
            yield from compared(together, of_file=True)


def _recordings_of(
    manifest: ReadManifest, file: NamedFile, told: list[str]
) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every grasp of a file; the first table takes what is to be `told` of the files."""
    for table in each_readable(file.name, partial(tables_of, manifest, file)):
        if isinstance(table, UnreadableRecording):
            yield table
            continue
        named = evolve(table, warnings=(*table.warnings, *told))
        told.clear()
        yield from each_readable(table.source, partial(grasps_in, manifest, file, named))


def manifest_files(place: str) -> list[Path]:
    """Return the files that a manifest describes, those beside them, and its list if it has one.

    Raises ConfigError, DataDamaged.
    """
    manifest = read_manifest(Path(os.path.expanduser(place)))
    listed_in = [manifest.place.parent / manifest.keys.list] if manifest.keys.list else []
    files = [file.path for file in files_of(manifest)]
    return [*listed_in, *files, *sorted(beside(manifest, {file.parent for file in files}))]


def tables_of(manifest: ReadManifest, file: NamedFile) -> list[ColumnTable]:
    """Return the tables of a file, each with the facts of its path. Raises ConfigError, DataDamaged."""
    if file.problem:
        raise ConfigError(file.problem)
    read = raw_tables(file.path, _rules(manifest))
    tables = [evolve(table.with_fields(file.fields), blank=file.blank) for table in read]
    for name in texts_of(manifest.keys.beside):
        path = file.path.parent / filled(manifest, "beside", name, tables[0])
        # `{number}_left.csv` has the columns `'left.NAME'`, of each recording alike.
        tables = _joined(manifest, tables, path, Path(FIELD.sub("", name)).stem.strip("_- .") or path.stem)
    if file.rows is not None:
        begin, end = file.rows
        if end > len(tables[0]):
            raise DataDamaged(f"{file.path} has {len(tables[0])} rows, and the list names row {end}")
        tables = [tables[0].rows(slice(begin - 1, end), f"rows {begin} to {end}")]
    split = manifest.keys.split
    if split == "rows":
        if too_many := RECORDINGS.exceeded(sum(map(len, tables))):
            raise DataDamaged(f"{file.path}: {too_many}")
        damaged = [table for table in tables if table.damage]
        rows = [table.rows(slice(k, k + 1), f"row {k + 1}") for table in tables for k in range(len(table))]
        return [*rows, *damaged]
    if split == "time":
        times = [name for part in manifest.expressions["time"] for name in part.names]
        return [part for table in tables for part in ([table] if table.damage else _by_clock(table, times))]
    if split and split != "force":
        return [part for table in tables for part in ([table] if table.damage else _by_column(table, split))]
    return tables


def _joined(manifest: ReadManifest, tables: list[ColumnTable], path: Path, prefix: str) -> list[ColumnTable]:
    """Return the table of a file with the columns, behind a prefix, of one beside it. Raises ConfigError, DataDamaged.

    Files with other numbers of rows are joined by their time, if both have the column that is the time.
    """
    others = raw_tables(path, _rules(manifest))
    rows = [len(table) for table in (*tables, *others)]
    times = [name for part in manifest.expressions["time"] for name in part.names]
    time = next((name for name in times if all(name in part.numbers for part in (*tables, *others))), None)
    if len(tables) != 1 or len(others) != 1 or (rows[0] != rows[1] and time is None):
        raise DataDamaged(
            f"{tables[0].source} and {path} beside it have {listed(list(map(str, rows)))} rows: each needs one table, "
            "with as many, or with the column of the time in both"
        )
    (table,), (other,) = tables, others
    warnings: tuple[str, ...] = ()
    if rows[0] == rows[1] and time is not None:
        warnings = tuple(_other_times(table, other, path, time))
    elif time is not None:
        unit = next((part.unit for part in manifest.expressions["time"] if part.unit), "")
        table, other = _by_time(table, other, time, unit or table.units.get(time, ""))

    def named(columns: Mapping[str, Any]) -> dict[str, Any]:
        return {f"{prefix}.{name}": column for name, column in columns.items()}

    return [
        evolve(
            table,
            numbers={**table.numbers, **named(other.numbers)},
            texts={**table.texts, **named(other.texts)},
            units={**table.units, **named(other.units)},
            shapes={**table.shapes, **named(other.shapes)},
            warnings=(*table.warnings, *warnings),
        )
    ]


def _by_time(table: ColumnTable, other: ColumnTable, time: str, unit: str) -> tuple[ColumnTable, ColumnTable]:
    """Return two tables at the times of the one with more rows, each with its last values. Raises DataDamaged."""
    parts, times = (table, other), _times_of(table, other, time)
    if not all(len(at_s) > 1 and (np.diff(at_s) > 0.0).all() for at_s in times):
        raise DataDamaged(
            f"{table.source} and {other.source} are joined by {time}, which has to increase in both"
        )
    # As the messages of two topics without headers.
    ns = 1e9 * TO_SI["time"].get(unit or unit_since_1970(float(times[0][0])), 1.0)
    began = min(at_s[0] for at_s in times)
    came = [list(map(round, ((at_s - began) * ns).tolist())) for at_s in times]
    topics = {
        part.source: Messages(recorded_ns=recorded_ns, stamped_ns=[0] * len(recorded_ns))
        for part, recorded_ns in zip(parts, came, strict=True)
    }
    clock = common_clock(time, topics)
    most = max(parts, key=len)
    rows_ns = clock.topics[most.source].between(clock.begin_ns, clock.end_ns)
    last = {part.source: clock.topics[part.source].latest(rows_ns)[0] for part in parts}
    joined = table.rows(last[table.source])
    return (
        evolve(
            joined,
            numbers={**joined.numbers, time: times[parts.index(most)][last[most.source]]},
            notes=(*table.notes, f"{other.source} is joined by {time}: the last value of each file is used"),
            warnings=(*table.warnings, *clock.notices),
        ),
        other.rows(last[other.source]),
    )


def _times_of(table: ColumnTable, other: ColumnTable, time: str) -> list[Numbers]:
    """Return the times of two tables on one clock; those in words count from the first one of their file.

    Raises DataDamaged for different units.
    """
    if table.units.get(time) != other.units.get(time):
        raise DataDamaged(f"{table.source} and {other.source} have their {time} in different units")
    times = [table.numbers[time], other.numbers[time]]
    if time in table.texts and time in other.texts:
        between = seconds_since_first([table.texts[time][0], other.texts[time][0]])
        times[1] = times[1] + (0.0 if between is None else between[1])
    return times


def _other_times(table: ColumnTable, other: ColumnTable, path: Path, time: str) -> Iterator[str]:
    """Yield that rows that are used together have different times."""
    times = _times_of(table, other, time)
    apart = np.abs(times[1] - times[0])
    largest = float(np.max(apart, initial=0.0, where=np.isfinite(apart)))
    if len(table) > 1 and largest * (len(table) - 1) > np.ptp(table.numbers[time]):
        yield (
            f"{path.name} is used row by row, and its {time} differs by up to {largest:.4g} from "
            f"that of {table.source}: if these are times of one clock, its rows belong elsewhere"
        )


def grasps_in(
    manifest: ReadManifest, file: NamedFile, table: ColumnTable
) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield the grasps of a table: several only where squeezes are to be found.

    What is wrong with one of several squeezes is told in its place. Raises ConfigError, DataDamaged.
    """
    if table.damage:
        raise DataDamaged(table.damage)
    columns = samples(manifest, table)
    if manifest.keys.split != "force":
        yield from _grasps(manifest, file, table, columns)
        return
    if turned := falls_on_closing(columns):
        raise DataDamaged(f"{columns.source}: no squeeze can be found: {turned}")
    for part in squeezes(columns):
        yield from each_readable(part.source, partial(_grasps, manifest, file, table, part))


def _grasps(
    manifest: ReadManifest, file: NamedFile, table: ColumnTable, columns: GraspColumns
) -> Iterator[LabelledRecording]:
    """Yield the one grasp that these samples of a table are. Raises ConfigError, DataDamaged."""
    keys = manifest.keys
    cut = cut_at(columns, keys.cut) if keys.cut else columns
    kept = resampled(cut, keys.resample_hz) if keys.resample_hz else cut
    with np.errstate(all="ignore"):  # what is infinite is refused by `checked_recording`
        notices = tuple(notices_of(cut, keys))
    yield LabelledRecording(
        recording=_checked(kept, table, keys.rate_hz or 1.0),
        source=cut.source,
        label=label_of(manifest, table),
        instance=instance_of(manifest, table),
        recorded_at=recorded_at_of(manifest, table),
        order=order_of(manifest, table),
        values=values_of(manifest, file, table),
        notices=notices,
    )


def _checked(columns: GraspColumns, table: ColumnTable, rate_hz: float) -> Recording:
    """Return the recording. Raises DataDamaged, with what looked wrong when the table was read."""
    try:
        return checked_recording(columns, rate_hz=rate_hz)
    except DataDamaged as error:
        if not table.warnings:
            raise
        raise DataDamaged(f"{error} ({'; '.join(table.warnings)})") from error


def _rules(manifest: ReadManifest) -> TableRules:
    """Return what the manifest says of the tables in its files."""
    parts = [part for alternatives in manifest.expressions.values() for part in alternatives]
    further = (*manifest.channels.values(), *manifest.values.values(), *manifest.events.values())
    return TableRules(
        start=manifest.keys.start,
        arrays=manifest.keys.arrays,
        axes=axes_of(manifest.keys.axes),
        samples={name for part in parts for name in part.names},
        used={name for part in (*parts, *further) for name in part.names},
    )


def _by_clock(table: ColumnTable, times: Sequence[str]) -> list[ColumnTable]:
    """Return a table for each part in which the time does not go back. Raises DataDamaged."""
    columns = [table.numbers[name] for name in times if name in table.numbers]
    begins = [k + 1 for column in columns[:1] for k in np.flatnonzero(np.diff(column) < 0.0).tolist()]
    if too_many := RECORDINGS.exceeded(len(begins) + 1):
        raise DataDamaged(f"{table.source}: {too_many}")
    bounds = pairwise([0, *begins, len(table)])
    return [table.rows(slice(begin, end), f"part {k}") for k, (begin, end) in enumerate(bounds, 1)]


def _by_column(table: ColumnTable, column: str) -> list[ColumnTable]:
    """Return a table for each value of a column, in the order in which the values occur.

    Rows without a value are of no grasp: they are left out, and a note tells how many. Raises ConfigError, DataDamaged.
    """
    values: Sequence[Any]
    if column in table.texts:
        values = table.texts[column]
    elif column in table.numbers and table.numbers[column].ndim == 1:
        values = table.numbers[column].tolist()
    else:
        known = listed((*table.numbers, *table.texts))
        raise ConfigError(f"split: {table.source} has no column {column!r}. Columns: {known}")
    rows: dict[Any, list[int]] = {}
    for k, value in enumerate(values):
        missing = is_missing_label(value) if isinstance(value, str) else math.isnan(value)
        rows.setdefault("" if missing else value, []).append(k)
    if without := rows.pop("", []):
        line = f" (from line {table.lines[without[0]]} on)" if table.lines is not None else ""
        left_out = f"left out: {counted(len(without), 'sample')} without a value of {column}{line}"
        table = evolve(table, notes=(*table.notes, left_out))
    if not rows:
        raise DataDamaged(f"split: {table.source} has no value of {column}")
    if too_many := RECORDINGS.exceeded(len(rows)):
        raise DataDamaged(f"{table.source}: {too_many}")
    return [
        table.rows(
            np.array(which), f"{column} {value:g}" if isinstance(value, float) else f"{column} {value}"
        )
        for value, which in rows.items()
    ]
