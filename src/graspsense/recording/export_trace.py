"""Exporting one recorded grasp: CSV, NPZ, Parquet, a copy of the MCAP file, or the settings as TOML."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from glob import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.components.channels import as_json
from graspsense.core.files.csv_text import csv_text
from graspsense.core.files.whole_file import write_new
from graspsense.core.values.channel import FLOATS, FastChannel, TactileArray
from graspsense.core.values.trace import PAD_COLUMNS, TICK_COLUMNS, ImageTrace
from graspsense.recording.foxglove import with_pictures
from graspsense.recording.layout import SIGNAL_TOPIC, TICK_FIELDS
from graspsense.recording.parquet import parquet
from graspsense.recording.recorded_grasp import RecordedGrasp

if TYPE_CHECKING:
    from numpy.typing import NDArray

Rows = Sequence[tuple[Any, ...]]
Names = tuple[str, ...]
"""The rows of a table, and the names of their columns."""


def write_csv(path: Path, grasp: RecordedGrasp) -> None:
    """Write one line per tick, with an empty cell for a missing channel.

    Images of the fingertips go to `NAME-pads.csv`, and each other topic to a file that is named after it. That of a
    fast channel has one line per sample, with the time and each axis. Images that are numpy arrays go to
    `NAME-CHANNEL.csv.npz`, with the arrays `t_s`, `counter` and `cells`. `FILE.json` has the channels, units and
    rate of the gripper, so that `import csv:FILE` reads the grasp back.
    """
    _write_tables(path, grasp, _csv)


def write_npz(path: Path, grasp: RecordedGrasp) -> None:
    """Write the columns of the trace as arrays with the names of `graspsense.Trace`.

    A further channel is `signal_NAME`; the times of an array or a fast channel are `signal_NAME_t_s`. The events of the
    controller are `event_t_s` and `event_name`, if there are any. `declared` is a JSON text with the channels, units
    and rate of the gripper, so that `import npz:FILE` reads the grasp back.
    """
    trace, out = grasp.trace(), io.BytesIO()
    columns = {name: getattr(trace, name) for name in (*TICK_COLUMNS, *PAD_COLUMNS)}
    columns["dt_s"] = grasp.ticks["dt_s"]
    columns["declared"] = np.array(json.dumps(_declared(grasp)))
    for name, signal in trace.signals.items():
        if isinstance(signal, np.ndarray):
            columns[f"signal_{name}"] = signal
        else:
            columns[f"signal_{name}_t_s"] = signal.t_s
            columns[f"signal_{name}"] = signal.cells if isinstance(signal, ImageTrace) else signal.values
    if trace.events:
        columns["event_t_s"] = np.array([event.t_s for event in trace.events])
        columns["event_name"] = np.array([event.what for event in trace.events])
    np.savez_compressed(out, allow_pickle=False, **columns)
    write_new(path, out.getvalue())


def write_parquet(path: Path, grasp: RecordedGrasp) -> None:
    """Write one row per tick, and the other topics as `write_csv` does. Raises PluginUnavailable without pyarrow."""
    _write_tables(path, grasp, _parquet)


def write_mcap(path: Path, grasp: RecordedGrasp) -> None:
    """Copy the recording."""
    write_new(path, grasp.path.read_bytes())


def write_pictures(path: Path, grasp: RecordedGrasp) -> None:
    """Copy the recording, with its tactile images as pictures for Foxglove. Raises ConfigError if it has none."""
    write_new(path, with_pictures(grasp))


def write_toml(path: Path, grasp: RecordedGrasp) -> None:
    """Write the settings of the grasp as a complete pipeline file."""
    write_new(path, grasp.record().settings_text.encode())


WRITERS: Final[Mapping[str, Callable[[Path, RecordedGrasp], None]]] = {
    ".csv": write_csv,
    ".npz": write_npz,
    ".parquet": write_parquet,
    ".mcap": write_mcap,
    ".toml": write_toml,
}
"""File extension to the function that writes it."""


def _write_tables(path: Path, grasp: RecordedGrasp, encoded: Callable[[Rows, Names], bytes]) -> None:
    """Write ticks and other topics as tables, and what the gripper declared; nothing if one cannot be encoded."""
    ticks = encoded(grasp.ticks.tolist(), TICK_FIELDS)
    tables = {name: encoded(rows, fields) for name, (rows, fields) in _tables(grasp)}
    for name, table in tables.items():
        write_new(beside(path, name), table)
    _write_declared(path, grasp, [*tables, *_write_cameras(path, grasp)])
    write_new(path, ticks)


def _tables(grasp: RecordedGrasp) -> Iterator[tuple[str, tuple[Rows, Names]]]:
    """Yield each topic beside the ticks and the cameras, with its rows and the names of their columns."""
    cameras = _cameras(grasp)
    fast = {
        SIGNAL_TOPIC + channel.name: channel for channel in grasp.channels if isinstance(channel, FastChannel)
    }
    signals = grasp.trace().signals if fast else {}
    for name, topic in grasp.topics.items():
        if name in cameras:
            continue
        channel = fast.get(name)
        if channel is None:
            yield name, _flat(topic.rows)
        else:
            samples = signals[channel.name]
            rows = np.column_stack([samples.t_s, samples.values]).tolist()
            yield name, (list(map(tuple, rows)), ("t_s", *channel.axes))


def _cameras(grasp: RecordedGrasp) -> dict[str, TactileArray]:
    """Return the arrays whose images are numpy arrays, by their topics."""
    arrays = [channel for channel in grasp.channels if isinstance(channel, TactileArray)]
    return {SIGNAL_TOPIC + array.name: array for array in arrays if array.dtype != FLOATS}


def _write_cameras(path: Path, grasp: RecordedGrasp) -> list[str]:
    """Write the images that are numpy arrays, a file each, and return their topics: a table has no room for them."""
    cameras = {name: array for name, array in _cameras(grasp).items() if name in grasp.topics}
    for name, array in cameras.items():
        rows, out = grasp.topics[name].rows, io.BytesIO()
        cells = rows["cells"].reshape(len(rows), *array.shape)
        np.savez_compressed(out, allow_pickle=False, t_s=rows["t_s"], counter=rows["counter"], cells=cells)
        write_new(images_beside(path, name), out.getvalue())
    return list(cameras)


def _flat(rows: NDArray[np.void]) -> tuple[Rows, Names]:
    """Return the rows of a topic with a number a column, and the names of these: those of an array are numbered."""
    fields: list[str] = []
    columns: list[list[Any]] = []
    for name in rows.dtype.names or ():
        values = rows[name]
        if values.ndim == 1:
            fields.append(name)
            columns.append(values.tolist())
        else:
            fields += [f"{name}_{i:02d}" for i in range(values.shape[1])]
            columns += values.T.tolist()
    return list(zip(*columns, strict=True)), tuple(fields)


def _csv(rows: Rows, fields: Names) -> bytes:
    return csv_text([fields, *rows]).encode()


def _parquet(rows: Rows, fields: Names) -> bytes:
    columns = zip(fields, zip(*rows, strict=True), strict=True)
    return parquet({name: (np.array(column), "") for name, column in columns})


def _declared(grasp: RecordedGrasp) -> dict[str, Any]:
    """Return what the gripper declared, as plain values."""
    recording = grasp.recording()
    return {
        "device": grasp.device.name,
        "rate_hz": recording.rate_hz,
        "units": recording.units,
        "has_release": recording.has_release,
        "channels": [as_json(channel) for channel in recording.channels],
        "mounting": {name: mounting.as_json() for name, mounting in recording.mounting.items()},
    }


def _write_declared(path: Path, grasp: RecordedGrasp, tables: Sequence[str]) -> None:
    """Write what the gripper declared, with the topics that have a file of their own."""
    cells = grasp.trace().pad_left.shape[1]
    text = json.dumps({**_declared(grasp), "cells": cells, "tables": list(tables)}, indent=1)
    write_new(declared_beside(path), (text + "\n").encode())


def declared_beside(path: Path) -> Path:
    """Return the file beside an exported grasp that says what its gripper declared."""
    return path.with_name(f"{path.name}.json")


def all_beside(path: Path) -> list[Path]:
    """Return the files that were exported beside a grasp; none if this is no exported grasp."""
    declared = declared_beside(path)
    return [declared, *sorted(path.parent.glob(f"{escape(path.stem)}-*"))] if declared.is_file() else []


def images_beside(path: Path, topic: str) -> Path:
    """Return the file of the images of a topic beside an exported grasp."""
    return path.with_name(f"{beside(path, topic).name}.npz")


def beside(path: Path, topic: str) -> Path:
    """Return the file of a topic beside an exported grasp."""
    return path.with_name(f"{path.stem}-{topic.rpartition('/')[2]}{path.suffix}")
