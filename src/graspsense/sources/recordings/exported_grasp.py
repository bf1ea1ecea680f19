"""One grasp that `graspsense export` wrote as NPZ, CSV or Parquet: frames, fingertips and further channels.

Images and samples are delivered in the first tick that is not before their time. Which samples were lost is not in such
a file; the recording itself (.mcap) keeps it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.channels import from_json, further
from graspsense.core.values.channel import Channel, FastChannel, TactileArray
from graspsense.core.values.mounting import mounting_from_json
from graspsense.core.values.signals import Frame, Pads, Reading, no_pads
from graspsense.recording.readable import readable
from graspsense.recording.replayable import REPLAY_NOTE, Recording
from graspsense.sources.columns.fast_samples import latest_values, signals_in_ticks, values_in_ticks
from graspsense.sources.formats.numpy_files import npz_arrays
from graspsense.sources.recordings.exported_grasp_tables import (
    TABLE_SUFFIXES,
    read_exported_tables,
    refuse_table_of_store,
)

Arrays = Mapping[str, NDArray[Any]]

DECLARED: Final = "declared"
"""The array of one JSON text with the channels, units and rate of the gripper."""


def read_exported(name: str) -> Recording:
    """Return the grasp in an .npz, .csv or .parquet file of `graspsense export`.

    Raises ConfigError if there is no such file, DataDamaged if it was not written by `graspsense export`, and
    PluginUnavailable for Parquet without pyarrow.
    """
    path = Path(name).expanduser()
    if path.suffix.lower() in TABLE_SUFFIXES:
        arrays, declared = read_exported_tables(path)
    else:
        arrays = npz_arrays(path)
        refuse_table_of_store(path, arrays)
        declared = str(arrays.get(DECLARED, "no JSON"))
    foreign = ". Arrays of other programs are imported by a manifest (docs/import.md)"
    with readable(path, "a grasp of `graspsense export`", foreign):
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


def _readings(arrays: Arrays, channels: tuple[Channel, ...]) -> list[Reading]:
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
