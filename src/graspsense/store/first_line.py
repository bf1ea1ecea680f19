"""The first frame of imported trials, as the features of a control: what a recording tells before anything happens."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
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


def numbers_of(frame: Frame) -> list[float]:
    """Return the numbers of a frame, in the order of `NAMES`."""
    return [getattr(frame, field) for field in _FIELDS.values()]


def first_lines(store: Store, recordings: Sequence[str], origins: Sequence[str]) -> FeatureTable | None:
    """Return the numbers of the first frame of each trial, NaN if it was not imported; None if none was.

    A recording that is lost or damaged has none; `graspsense verify` reports it.
    """
    if "import" not in origins:
        return None
    values = np.full((len(recordings), len(NAMES)), np.nan)
    for row, (recording, origin) in enumerate(zip(recordings, origins, strict=True)):
        if origin != "import":
            continue
        with suppress(ConfigError, DataDamaged):
            frame = read_first_frame(store.recording_path(recording))
            if frame is not None:
                values[row] = numbers_of(frame)
    values[np.isinf(values)] = np.nan
    return FeatureTable(names=NAMES, units=UNITS, values=values)


def imported_gaps(store: Store, recordings: Sequence[str], origins: Sequence[str]) -> Iterator[list[float]]:
    """Yield the gaps of each imported recording that can be read."""
    for recording, origin in zip(recordings, origins, strict=True):
        if origin == "import":
            with suppress(ConfigError, DataDamaged):
                yield [
                    reading.frame.gap_m
                    for reading in read_recorded(store.recording_path(recording)).readings()
                ]
