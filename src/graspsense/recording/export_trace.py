"""Exporting one recorded grasp: CSV, NPZ, Parquet, a copy of the MCAP file, or the settings as TOML."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.trace import PAD_COLUMNS, TICK_COLUMNS
from graspsense.recording.atomic_file import write_new
from graspsense.recording.layout import PADS_FIELDS, TICK_FIELDS
from graspsense.recording.parquet import parquet

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.recording.reader import RecordedGrasp


def write_csv(path: Path, grasp: RecordedGrasp) -> None:
    """Write one line per tick, with an empty cell for a missing channel. Pad images go to `NAME-pads.csv`."""
    if len(grasp.pads):
        write_new(_pads_beside(path), _csv(grasp.pads, PADS_FIELDS))
    write_new(path, _csv(grasp.ticks, TICK_FIELDS))


def write_npz(path: Path, grasp: RecordedGrasp) -> None:
    """Write the columns of the trace as arrays with the names of `graspsense.Trace`."""
    trace, out = grasp.trace(), io.BytesIO()
    columns = {name: getattr(trace, name) for name in (*TICK_COLUMNS, *PAD_COLUMNS)}
    np.savez_compressed(out, allow_pickle=False, **columns)
    write_new(path, out.getvalue())


def write_parquet(path: Path, grasp: RecordedGrasp) -> None:
    """Write one row per tick. Pad images go to `NAME-pads.parquet`. Raises PluginUnavailable without pyarrow."""
    ticks = parquet({name: (grasp.ticks[name], "") for name in TICK_FIELDS})
    if len(grasp.pads):
        write_new(_pads_beside(path), parquet({name: (grasp.pads[name], "") for name in PADS_FIELDS}))
    write_new(path, ticks)


def write_mcap(path: Path, grasp: RecordedGrasp) -> None:
    """Copy the recording."""
    write_new(path, grasp.path.read_bytes())


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


def _csv(rows: NDArray[np.void], fields: tuple[str, ...]) -> bytes:
    out = io.StringIO(newline="")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(fields)
    for row in rows.tolist():
        writer.writerow(["" if isinstance(cell, float) and math.isnan(cell) else repr(cell) for cell in row])
    return out.getvalue().encode()


def _pads_beside(path: Path) -> Path:
    return path.with_name(f"{path.stem}-pads{path.suffix}")
