"""One grasp that `graspsense export` wrote as NPZ, CSV or Parquet: frames, fingertips and further channels.

Images and samples are delivered in the first tick that is not before their time. Which samples were lost is not in such
a file; the recording itself (.mcap) keeps it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.components.channels import (
    cells_of,
    from_json,
    further,
    no_signals,
    read_only,
    signal_type,
)
from graspsense.core.values.channel import FLOATS, Channel, FastChannel, TactileArray
from graspsense.core.values.mounting import mounting_from_json
from graspsense.core.values.signals import Frame, Image, Pads, Reading, no_pads
from graspsense.recording.readable import readable
from graspsense.recording.replayable import REPLAY_NOTE, Recording
from graspsense.sources.columns.fast_samples import latest_values, sample_blocks
from graspsense.sources.formats.numpy_files import npz_arrays
from graspsense.sources.recordings.exported_grasp_tables import (
    TABLE_SUFFIXES,
    read_exported_tables,
    refuse_table_of_store,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

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
    n = len(frames)
    cells = arrays["pad_left"].shape[1]
    images = [
        Pads(t_s, k, tuple(left), tuple(right))
        for k, (t_s, left, right) in enumerate(
            zip(*(arrays[f"pad_{column}"].tolist() for column in ("t_s", "left", "right")), strict=True), 1
        )
    ]
    pads = latest_values(times, arrays["pad_t_s"], images, no_pads(cells))
    signals: list[Any] = [()] * n
    if channels:
        make = signal_type(channels)._make  # type: ignore[attr-defined]
        series = [_series(times, arrays, channel) for channel in channels]
        signals = [make(values) for values in zip(*series, strict=True)]
    return [Reading(*values) for values in zip(frames, pads, signals, strict=True)]


def _series(times: NDArray[np.float64], arrays: Arrays, channel: Channel) -> list[Any]:
    """Return the value of a further channel in each tick."""
    values = arrays[f"signal_{channel.name}"]
    if isinstance(channel, TactileArray):
        sampled_s = arrays[f"signal_{channel.name}_t_s"]
        if channel.dtype != FLOATS:
            values = read_only(values, channel.dtype)  # once, so that its images are passed by reference
        images = [
            Image(t_s, k, cells_of(channel, cells))
            for k, (t_s, cells) in enumerate(zip(sampled_s.tolist(), values, strict=True), 1)
        ]
        return latest_values(times, sampled_s, images, no_signals((channel,))[0])
    if isinstance(channel, FastChannel):
        return sample_blocks(times, arrays[f"signal_{channel.name}_t_s"], values, channel)
    return list(values.tolist())
