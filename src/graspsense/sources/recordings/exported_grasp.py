"""One grasp that `graspsense export` wrote as NPZ, CSV or Parquet: frames, fingertips and further channels.

Images and samples are delivered in the first tick that is not before their time. Which samples were lost is not in such
a file; the recording itself (.mcap) keeps it.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.channels import from_json, further
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.limits import CHANNEL_NUMBERS
from graspsense.core.values.mounting import mounting_from_json
from graspsense.core.values.signals import Frame, Pads, Reading, no_pads
from graspsense.recording.export_trace import beside, declared_beside, images_beside
from graspsense.recording.layout import PADS_TOPIC, SCALARS_TOPIC, SIGNAL_TOPIC, TICK_FIELDS
from graspsense.recording.readable import readable
from graspsense.recording.replayable import REPLAY_NOTE, Recording
from graspsense.sources.columns.fast_samples import latest_values, signals_in_ticks, values_in_ticks
from graspsense.sources.formats.file_text import text_of
from graspsense.sources.formats.numpy_files import npz_arrays
from graspsense.sources.formats.raw_tables import raw_tables
from graspsense.sources.formats.table import Numbers

Columns = dict[str, NDArray[Any]]

DECLARED: Final = "declared"
"""The array of one JSON text with the channels, units and rate of the gripper."""
TABLE_SUFFIXES: Final = (".csv", ".parquet")
_ABOUT_TRIALS: Final = ("trial", "made_at", "outcome", "recording")
"""Columns of every table of a store."""


def read_exported(name: str) -> Recording:
    """Return the grasp in an .npz, .csv or .parquet file of `graspsense export`.

    Raises ConfigError if there is no such file, DataDamaged if it was not written by `graspsense export`, and
    PluginUnavailable for Parquet without pyarrow.
    """
    path = Path(os.path.expanduser(name))
    foreign = ". Arrays of other programs are imported by a manifest (docs/import.md)"
    with readable(path, "a grasp of `graspsense export`", foreign):
        if path.suffix.lower() in TABLE_SUFFIXES:
            arrays, declared = _tables(path)
        else:
            arrays = npz_arrays(path)
            refuse_table_of_store(path, arrays)
            declared = str(arrays.get(DECLARED, "no JSON"))
        about = json.loads(declared)
        channels = tuple(from_json(channel) for channel in about["channels"])
        return Recording(
            name=f"export {path.name} of {about['device']}",
            readings=tuple(_readings(arrays, further(channels))),
            rate_hz=float(about["rate_hz"]),
            units=dict(about["units"]),
            notes=(REPLAY_NOTE,),
            commands=None if np.isnan(arrays["command"]).any() else tuple(arrays["command"].tolist()),
            has_release=bool(about["has_release"]),
            channels=channels,
            mounting=mounting_from_json(about.get("mounting", {})),
        )


def _readings(arrays: Columns, channels: tuple[Channel, ...]) -> list[Reading]:
    times = arrays["t_s"]
    frames = [
        Frame._make((*values[:-1], int(values[-1])))
        for values in zip(*(arrays[name].tolist() for name in Frame._fields), strict=True)
    ]
    cells = arrays["pad_left"].shape[1]
    images = [
        Pads(t_s, k, tuple(left), tuple(right))
        for k, (t_s, left, right) in enumerate(
            zip(*(arrays[f"pad_{column}"].tolist() for column in ("t_s", "left", "right")), strict=True), 1
        )
    ]
    pads = latest_values(times, arrays["pad_t_s"], images, no_pads(cells))
    series = []
    for channel in channels:
        name, own = f"signal_{channel.name}", isinstance(channel, TactileArray | FastChannel)
        sampled_s = arrays[f"{name}_t_s"] if own else None
        series.append(values_in_ticks(times, sampled_s, arrays[name], channel))
    signals = signals_in_ticks(channels, series, len(frames))
    return [Reading(*values) for values in zip(frames, pads, signals, strict=True)]


def _tables(path: Path) -> tuple[Columns, str]:
    """Return the tables of an exported grasp as the arrays of its NPZ file, and the JSON text that declares them.

    Raises ConfigError if a file is missing, DataDamaged if one is not as `graspsense export` writes it, and
    PluginUnavailable for Parquet without pyarrow.
    """
    declared = declared_beside(path)
    if path.exists() and not declared.exists():
        undeclared = raw_tables(path)[0]
        refuse_table_of_store(path, (*undeclared.numbers, *undeclared.texts))
        raise ConfigError(
            f"{declared.name} is missing beside {path}: `graspsense export` writes it together with the columns. For a "
            "file of another program name its columns, or write a manifest (docs/import.md)"
        )
    ticks = _columns(path)
    missing = [name for name in TICK_FIELDS if name not in ticks]
    if missing:
        raise DataDamaged(f"{path} is not an exported grasp: it has no column {missing[0]!r}")
    with readable(declared):
        text = text_of(declared)
        about = json.loads(text)
        channels = further(tuple(from_json(channel) for channel in about["channels"]))
        tables = frozenset(about["tables"])
        cells = int(about["cells"])
    if too_many := CHANNEL_NUMBERS.exceeded(cells):
        raise DataDamaged(f"{declared} is damaged: the fingertips have {too_many}")

    def table(topic: str) -> Columns:
        return _columns(beside(path, topic)) if topic in tables else {"t_s": np.empty(0)}

    pads = table(PADS_TOPIC)
    ticks["pad_t_s"] = pads["t_s"]
    for side in ("left", "right"):
        ticks[f"pad_{side}"] = _together(pads, [f"{side}_{i:02d}" for i in range(cells)])
    scalars = table(SCALARS_TOPIC)
    for channel in channels:
        name, topic = f"signal_{channel.name}", SIGNAL_TOPIC + channel.name
        if isinstance(channel, TactileArray) and channel.dtype != FLOATS:
            nothing = {"t_s": np.empty(0), "cells": np.empty((0, *channel.shape))}
            images = npz_arrays(images_beside(path, topic)) if topic in tables else nothing
            ticks[f"{name}_t_s"], ticks[name] = images["t_s"], images["cells"]
        elif isinstance(channel, TactileArray | FastChannel):
            samples = table(topic)
            fields = (
                channel.axes
                if isinstance(channel, FastChannel)
                else [f"cells_{i:02d}" for i in range(channel.numbers)]
            )
            ticks[f"{name}_t_s"], ticks[name] = samples["t_s"], _together(samples, fields)
        else:
            ticks[name] = scalars[channel.name]
    return ticks, text


def _together(table: Columns, names: Sequence[str]) -> Numbers:
    """Return these columns side by side: (rows, columns)."""
    if len(table["t_s"]) == 0:
        return np.empty((0, len(names)))
    return np.column_stack([table[name] for name in names])


def refuse_table_of_store(path: Path, names: Iterable[str]) -> None:
    """Raise ConfigError if these are the columns of the table of a store, which has no ticks."""
    if set(_ABOUT_TRIALS) <= set(names):
        raise ConfigError(
            f"{path} is the table of a store, with one row for each grasp, so there is no grasp to import. Learn from "
            "it as FILE.csv: graspsense train FILE.csv --label label --out MODEL.json. Or export single grasps: "
            f"graspsense export DIR#12 --to FILE{path.suffix.lower()}"
        )


def _columns(path: Path) -> Columns:
    """Return the columns of one file. Raises ConfigError, DataDamaged, PluginUnavailable."""
    table = raw_tables(path)[0]
    if texts := [name for name in table.texts if name not in table.numbers]:
        where = table.not_numbers.get(texts[0], "a text")
        raise DataDamaged(f"{path}: {texts[0]} is not a column of numbers: {where}")
    return dict(table.numbers)
