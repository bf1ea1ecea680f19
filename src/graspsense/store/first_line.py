"""The first frame of imported trials, as the features of a control: what a recording tells before anything happens."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from typing import Final

import numpy as np

from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.features import FeatureTable
from graspsense.core.values.signals import CHANNEL_OF_FIELD, CHANNELS, Frame
from graspsense.recording.reader import read_first_frame, read_recorded
from graspsense.store.store import Store

_FIELDS: Final = {channel: field for field, channel in CHANNEL_OF_FIELD.items() if "edge" not in channel}
"""Channel to its field of a frame."""
NAMES: Final = tuple(f"{channel}_first" for channel in _FIELDS)
UNITS: Final = tuple(CHANNELS[channel] for channel in _FIELDS)


def first_line_table(frames: Iterable[Frame | None]) -> FeatureTable:
    """Return the numbers of the first frames of trials; NaN where there is none, or no finite number."""
    missing = [np.nan] * len(NAMES)
    rows = [
        missing if frame is None else [getattr(frame, name) for name in _FIELDS.values()] for frame in frames
    ]
    values = np.array(rows, dtype=np.float64).reshape(-1, len(NAMES))
    values[np.isinf(values)] = np.nan
    return FeatureTable(names=NAMES, units=UNITS, values=values)


def first_lines(store: Store, recordings: Sequence[str], origins: Sequence[str]) -> FeatureTable | None:
    """Return the numbers of the first frame of each trial, NaN if it was not imported; None if none was.

    A recording that is lost or damaged has none; `graspsense verify` reports it.
    """
    if "import" not in origins:
        return None
    frames: list[Frame | None] = [None] * len(recordings)
    for row, (recording, origin) in enumerate(zip(recordings, origins, strict=True)):
        if origin == "import":
            with suppress(ConfigError, DataDamaged):
                frames[row] = read_first_frame(store.recording_path(recording))
    return first_line_table(frames)


def imported_gaps(store: Store, recordings: Sequence[str], origins: Sequence[str]) -> Iterator[list[float]]:
    """Yield the gaps of each imported recording that can be read."""
    for recording, origin in zip(recordings, origins, strict=True):
        if origin == "import":
            with suppress(ConfigError, DataDamaged):
                yield [
                    reading.frame.gap_m
                    for reading in read_recorded(store.recording_path(recording)).readings()
                ]
