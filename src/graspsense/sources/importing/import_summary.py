"""What an import understood of its recordings: labels, instances, samples, rates, ranges and what looks wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, Final

import numpy as np
from attrs import frozen

from graspsense.core.components.channels import further
from graspsense.core.values.label_text import natural_order
from graspsense.core.values.signals import CHANNEL_OF_FIELD
from graspsense.core.values.trace import SI_UNITS, ImageTrace, signals_of
from graspsense.recording.labelled_recording import LabelledRecording
from graspsense.recording.replayable import Recording
from graspsense.sources.columns.channel_facts import ChannelFacts, channel_facts, together
from graspsense.sources.columns.recording_notices import notices_together
from graspsense.sources.formats.table import Numbers

CHANNEL_OF: Final = {
    field: CHANNEL_OF_FIELD[field] for field in ("gap_m", "effort_n", "force_left_n", "force_right_n")
}
"""Field of a frame to the channel that it is."""


@frozen(kw_only=True)
class LabelSummary:
    """The recordings of one label: how many they are, of how many objects, and the ranges of their values.

    The gap is in m and the forces are in N unless the recordings have other units.
    """

    label: str
    grasps: int
    instances: int | None
    samples: tuple[int, int]
    rate_hz: tuple[float, float]
    gap: tuple[float, float]
    left: tuple[float, float]
    right: tuple[float, float]


@frozen(kw_only=True)
class ImportSummary:
    """All recordings of an import."""

    grasps: int
    labels: tuple[LabelSummary, ...]
    units: dict[str, str]
    channels: tuple[str, ...]
    values: tuple[str, ...]
    recorded: tuple[str, str] | None
    """The first and the last time of recording; None unless every recording has one."""
    notes: tuple[str, ...]
    """How the first recording came about."""
    notices: tuple[str, ...]
    """What looks wrong, and in how many recordings."""
    measured: tuple[ChannelFacts, ...]
    """What the samples of each channel show, in all recordings together; lengths in m."""


def summary_of(recordings: Sequence[LabelledRecording]) -> ImportSummary:
    """Return the summary of at least one recording."""
    by_label: dict[str, list[LabelledRecording]] = {}
    for recording in recordings:
        by_label.setdefault(recording.label, []).append(recording)
    earliest = recordings[0].recording
    times = sorted(recording.recorded_at for recording in recordings)
    return ImportSummary(
        grasps=len(recordings),
        labels=tuple(_label(label, by_label[label]) for label in natural_order(by_label)),
        units=dict(earliest.units),
        channels=tuple(f"{channel.name} [{channel.unit}]" for channel in further(earliest.channels)),
        values=tuple(dict.fromkeys(name for recording in recordings for name in recording.values)),
        recorded=(times[0], times[-1]) if times[0] else None,
        notes=earliest.notes,
        notices=notices_together(recordings),
        measured=_measured([recording.recording for recording in recordings]),
    )


def _measured(recordings: Sequence[Recording]) -> tuple[ChannelFacts, ...]:
    parts: dict[str, list[ChannelFacts]] = {}
    for recording in recordings:
        units = {
            **SI_UNITS,
            **recording.units,
            **{channel.name: channel.unit for channel in recording.channels},
        }
        for name, values, t_s in _series(recording):
            parts.setdefault(name, []).append(channel_facts(name, units.get(name, "1"), values, t_s))
    return tuple(map(together, parts.values()))


def _series(recording: Recording) -> Iterator[tuple[str, Numbers, Numbers]]:
    """Yield the values of each channel that the recording has, with their times: of the frame, numbers, and images."""
    t_s, *fields = recording.columns("t_s", *CHANNEL_OF)
    for name, values in zip(CHANNEL_OF.values(), fields, strict=True):
        if np.isfinite(values).any():
            yield name, values, t_s
    for name, signal in signals_of([reading.signals for reading in recording.readings]).items():
        if isinstance(signal, ImageTrace):
            if len(signal.t_s):
                yield name, np.asarray(signal.cells), signal.t_s
        elif isinstance(signal, np.ndarray):
            yield name, signal, t_s


def _label(label: str, recordings: Sequence[LabelledRecording]) -> LabelSummary:
    instances = {recording.instance for recording in recordings}
    fields = ("gap_m", "force_left_n", "force_right_n")
    gap, left, right = np.hstack([recording.recording.columns(*fields) for recording in recordings])
    return LabelSummary(
        label=label,
        grasps=len(recordings),
        instances=None if "" in instances else len(instances),
        samples=_range([len(recording.recording.readings) for recording in recordings]),
        rate_hz=_range([recording.recording.rate_hz for recording in recordings]),
        gap=_range(gap),
        left=_range(left),
        right=_range(right),
    )


def _range(values: Any) -> tuple[Any, Any]:
    array = np.asarray(values)
    if np.isnan(array).all():
        return np.nan, np.nan
    return np.nanmin(array).item(), np.nanmax(array).item()
