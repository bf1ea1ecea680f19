"""One recorded grasp: its ticks, the messages of its other topics, and what a trace or a replay is made of."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import numpy as np
from attrs import evolve, field, frozen
from numpy.typing import NDArray

from graspsense.core.components.channels import (
    cells_of,
    declared_dtype,
    declared_shape,
    further,
    no_signals,
    signal_type,
)
from graspsense.core.values.channel import Channel as DeclaredChannel
from graspsense.core.values.channel import FastChannel, TactileArray
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.signals import (
    APPROACH,
    LABELLED,
    Frame,
    GraspEvent,
    Image,
    Pads,
    Phase,
    Reading,
    Samples,
    event_from_json,
    no_pads,
)
from graspsense.core.values.trace import SI_UNITS, Trace
from graspsense.recording.layout import (
    EVENT,
    KINDS,
    PADS_TOPIC,
    SCALARS_TOPIC,
    SIGNAL_TOPIC,
    Topic,
    pads_topic,
    shown_array,
)
from graspsense.recording.readable import readable
from graspsense.recording.replayable import REPLAY_NOTE, Recording, trace_of_readings
from graspsense.recording.trial_record import DeviceRecord, TrialRecord

_KINDS: Final = {kind: np.dtype(name).newbyteorder("<") for kind, name in KINDS.items()}


def row_type(topic: Topic) -> np.dtype[np.void]:
    """Return the type of a row with the fields of a topic."""
    return np.dtype(
        [
            (name, _KINDS[kind], (number,)) if number else (name, _KINDS[kind])
            for name, kind, number in topic.fields
        ]
    )


@frozen(kw_only=True, eq=False)
class TopicRows:
    """The messages of a topic, one row each, in the order of writing. Row `i` precedes tick `next_tick[i]`."""

    topic: Topic
    rows: NDArray[np.void]
    next_tick: tuple[int, ...]

    def numbers(self, i: int) -> tuple[Any, ...]:
        """Return the numbers of row `i`, as `Topic.wire` packs them."""
        flat: list[Any] = []
        for value in self.rows[i].item():
            flat += value.tolist() if isinstance(value, np.ndarray) else [value]
        return tuple(flat)


@frozen(kw_only=True, eq=False)
class RecordedGrasp:
    """One recorded grasp.

    `ticks` has one row of `layout.TICK_FIELDS` per tick, in the order of writing. `topics` holds the messages of the
    other topics by their names: the images of the fingertips, the further channels. `complete` states whether the file
    has its end. If not, `damage` is the reason, and `lost` the number of messages known to be missing between those
    that were read.
    """

    path: Path
    ticks: NDArray[np.void]
    topics: Mapping[str, TopicRows]
    metadata: Mapping[str, Mapping[str, str]]
    complete: bool
    damage: str = ""
    lost: int = 0
    base_ns: int | None = None
    """Wall clock at time 0 of the gripper's clock; None if there is no message."""
    device: DeviceRecord = field(factory=DeviceRecord)

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.ticks)

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each channel, and of the time `t`."""
        return {**SI_UNITS, **self.device.units}

    def record(self) -> TrialRecord:
        """Return everything that is stored of the trial besides its ticks. Raises DataDamaged."""
        return TrialRecord.from_sections(self.metadata, str(self.path))

    def _readable_record(self) -> TrialRecord | None:
        try:
            return self.record()
        except DataDamaged:
            return None

    @property
    def pads(self) -> NDArray[np.void]:
        """The images of the fingertips, one row each: `t_s`, `counter`, and the cells of both."""
        topic = self.topics.get(PADS_TOPIC)
        return np.empty(0, row_type(pads_topic(0))) if topic is None else topic.rows

    @property
    def images(self) -> int:
        """The number of images of the fingertips and of all other arrays."""
        return sum(
            len(topic.rows)
            for name, topic in self.topics.items()
            if name == PADS_TOPIC or "cells" in (topic.rows.dtype.names or ())
        )

    @property
    def channels(self) -> tuple[DeclaredChannel, ...]:
        """The recorded arrays and further channels, as the gripper declared them or else as their messages show."""
        declared = {channel.name: channel for channel in self.device.channels}
        shown: list[DeclaredChannel] = []
        for name, topic in self.topics.items():
            numbers = {field: max(number, 1) for field, _, number in topic.topic.fields}
            if name == SCALARS_TOPIC:
                shown += [DeclaredChannel(field, "unknown") for field in numbers if field != "t_s"]
            elif name.startswith(SIGNAL_TOPIC) and "cells" in numbers:
                shown.append(shown_array(topic.topic))
            elif name.startswith(SIGNAL_TOPIC):
                axes = int(topic.rows["axes"][0]) if len(topic.rows) else numbers["values"]
                shown.append(
                    FastChannel(
                        name[len(SIGNAL_TOPIC) :],
                        "unknown",
                        samples=numbers["values"] // axes,
                        axes=tuple(f"axis_{i}" for i in range(axes)),
                    )
                )
        kept = []
        for channel in shown:
            said = declared.get(channel.name)
            same = said is not None and (declared_shape(said), declared_dtype(said)) == (
                declared_shape(channel),
                declared_dtype(channel),
            )
            kept.append(said if same and said is not None else channel)
        return (*(channel for channel in self.device.channels if channel.name == "pads"), *kept)

    def events(self) -> tuple[GraspEvent, ...]:
        """Return the events that the controller told, also of a grasp that was cut off.

        Those of a damaged recording, of which only a part was read, may be missing.
        """
        try:
            return self.told_events()
        except DataDamaged:
            return ()

    def told_events(self) -> tuple[GraspEvent, ...]:
        """Return the events that the controller told. Raises DataDamaged if they cannot be read."""
        with readable(f"the list of events of the recording {self.path}"):
            result = self.record().result
            listed = self._events_as_told() if result is None else result.details.get("events", ())
            return tuple(event_from_json(event) for event in listed if event.get("source") == "controller")

    def labelled_events(self) -> dict[str, tuple[GraspEvent, ...]]:
        """Return the events that others labelled in an imported recording, by their names; of a damaged one, none."""
        record = self._readable_record()
        details = {} if record is None or record.result is None else record.result.details
        names = str((details.get("report") or {}).get(LABELLED, ""))
        events = [
            event_from_json(event) for event in details.get("events") or () if event.get("source") == "label"
        ]
        return {
            name: tuple(event for event in events if event.what == name) for name in names.split(", ") if name
        }

    def _events_as_told(self) -> list[Any]:
        """Return the events that were written when they happened."""
        names = [name for name in self.metadata if name.startswith(EVENT)]
        names.sort(key=lambda name: int(name.removeprefix(EVENT)))
        return [json.loads(self.metadata[name]["event"]) for name in names]

    def trace(self) -> Trace:
        """Return the trace of the grasp. Raises DataDamaged if its messages do not fit each other."""
        with readable(f"the recording {self.path}"):
            return self._trace()

    def _trace(self) -> Trace:
        phases, commands = self.ticks["phase"].tolist(), self.ticks["command"].tolist()
        trace = trace_of_readings(self.readings(), self.units, phases, commands)
        return evolve(trace, events=self.events())

    def readings(self) -> tuple[Reading, ...]:
        """Return the readings of the gripper, one per tick, each with what was new then or before."""
        images = self._images()
        image = no_pads(len(images[0].left) if images else 0)
        pads_before = self.topics[PADS_TOPIC].next_tick if images else ()
        signals, following = self._signals(), 0
        readings: list[Reading] = []
        for k, row in enumerate(self.ticks.tolist()):
            while following < len(images) and pads_before[following] <= k:
                image, following = images[following], following + 1
            readings.append(Reading(Frame(*row[: len(Frame._fields)]), image, signals[k] if signals else ()))
        return tuple(readings)

    def _images(self) -> list[Pads]:
        topic = self.topics.get(PADS_TOPIC)
        if topic is None:
            return []
        images = []
        for i in range(len(topic.rows)):
            t_s, counter, *cells = topic.numbers(i)
            half = len(cells) // 2
            images.append(Pads(t_s, counter, tuple(cells[:half]), tuple(cells[half:])))
        return images

    def _signals(self) -> list[Any]:
        """Return the value of `Reading.signals` in each tick; empty where there are no further channels."""
        channels = further(self.channels)
        if not channels:
            return []
        columns = [
            self._column(channel, nothing)
            for channel, nothing in zip(channels, no_signals(channels), strict=True)
        ]
        return list(map(signal_type(channels)._make, zip(*columns, strict=True)))  # type: ignore[attr-defined]

    def _column(self, channel: DeclaredChannel, nothing: Any) -> list[Any]:
        """Return the value of a further channel in each tick, `nothing` before the first one."""
        own = isinstance(channel, TactileArray | FastChannel)
        topic = self.topics[SIGNAL_TOPIC + channel.name if own else SCALARS_TOPIC]
        values: list[Any]
        last = np.searchsorted(topic.next_tick, np.arange(len(self.ticks)), side="right") - 1
        if isinstance(channel, TactileArray):
            values = [
                Image(float(row["t_s"]), int(row["counter"]), cells_of(channel, row["cells"]))
                for row in topic.rows
            ]
        elif own:
            shape = declared_shape(channel)
            values = [_samples(row, row["values"].reshape(shape).tolist()) for row in topic.rows]
        else:
            values = topic.rows[channel.name].tolist()
        column = [values[k] if k >= 0 else nothing for k in last.tolist()]
        if isinstance(
            channel, FastChannel
        ):  # an image stays until the next one, and samples are new in one tick only
            for k in np.flatnonzero((np.diff(last) == 0) & (last[1:] >= 0)) + 1:
                column[k] = column[k]._replace(new=0, values=nothing.values)
        return column

    def recording(self) -> Recording:
        """Return the grasp in the form that a gripper can replay. Raises DataDamaged as `trace`."""
        with readable(f"the recording {self.path}"):
            # An imported recording has no commands, and ends where the imported file ends.
            known = not np.isnan(self.ticks["command"]).any()
            record, times = self._readable_record(), self.ticks["t_s"]
            elapsed = float(times[-1] - times[0]) if len(times) else 0.0
            return Recording(
                name=f"recording {self.path.name} of {self.device.name or 'an unknown gripper'}",
                readings=self.readings(),
                rate_hz=self.device.rate_hz or ((len(times) - 1) / elapsed if elapsed > 0.0 else 1000.0),
                units={name: unit for name, unit in self.units.items() if SI_UNITS.get(name) != unit},
                notes=(*self.device.notes, REPLAY_NOTE),
                commands=tuple(self.ticks["command"].tolist()) if known else None,
                has_release=known and bool((self.ticks["phase"] == Phase.RELEASE).any()),
                channels=self.channels,
                mounting=self.device.mounting,
                events=self.labelled_events(),
                recorded_with={} if record is None else record.recorded_with,
            )


def _samples(row: Any, values: list[list[float]]) -> Samples:
    """Return the samples of a message, given its values."""
    new = min(max(int(row["new"]), 0), len(values))
    return Samples(float(row["t_s"]), int(row["counter"]), new, tuple(map(tuple, values)))


def with_phases_of(whole: Trace, replayed: Trace) -> Trace:
    """Return the whole trace with the phases of a replay, of which the last one holds after its end.

    A controller that saw a rest, or a failure, ends a replay before the recording does.
    """
    phases = replayed.phase[: len(whole)]
    last = int(phases[-1]) if len(phases) else APPROACH
    held = np.full(len(whole) - len(phases), last, dtype=np.int64)
    return evolve(whole, phase=np.concatenate((phases, held)), events=replayed.events)
