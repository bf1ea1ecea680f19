"""Reading a recording: either completely, or, for recovery, as much of it as can be read.

Files are not trusted: lengths are bounded, checksums are verified, and nothing in a file is executed.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Final

import numpy as np
from attrs import evolve, field, frozen
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema

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
from graspsense.core.values.errors import ConfigError, DataDamaged, TooLarge, named
from graspsense.core.values.events import LABELLED, GraspEvent, event_from_json
from graspsense.core.values.limits import CHANNEL_NUMBERS
from graspsense.core.values.signals import Frame, Image, Pads, Phase, Reading, Samples, no_pads
from graspsense.core.values.trace import SI_UNITS, Trace, trace_of
from graspsense.recording.layout import (
    CDR_HEADER,
    DEVICE,
    EVENT,
    KINDS,
    PADS_TOPIC,
    PART,
    SCALARS_TOPIC,
    SIGNAL_TOPIC,
    START,
    TICK,
    TICK_FIELDS,
    TICK_SCHEMA,
    TICK_TOPIC,
    VERSION,
    Topic,
    pads_topic,
    pads_topic_by_cell,
    shown_array,
)
from graspsense.recording.mcap_records import records_in, records_of
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.replayable import REPLAY_NOTE, Recording
from graspsense.recording.trial_record import DeviceRecord, TrialRecord
from graspsense.recording.unpacked import Unpacked

if TYPE_CHECKING:
    from numpy.typing import NDArray


def largest_record() -> int:
    """Return the limit on the bytes of a record: 64 MB, and more where larger channels are allowed.

    A chunk ends with the message that makes it larger than 16 MB. Raises ConfigError as `CHANNEL_NUMBERS.most`.
    """
    return max(1 << 26, (1 << 25) + 24 * CHANNEL_NUMBERS.most)


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

    @property
    def pads(self) -> NDArray[np.void]:
        """The images of the fingertips, one row each: `t_s`, `counter`, and the cells of both."""
        topic = self.topics.get(PADS_TOPIC)
        return np.empty(0, _row_type(pads_topic(0))) if topic is None else topic.rows

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
        try:
            result = self.record().result
        except DataDamaged:
            return {}
        details = {} if result is None else result.details
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
        readings = self.readings()
        trace = trace_of(
            [reading.frame for reading in readings],
            phases,
            commands,
            self._images(),
            self.units,
            [reading.signals for reading in readings] if further(self.channels) else (),
        )
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
        scalar = not isinstance(channel, TactileArray | FastChannel)
        topic = self.topics[SCALARS_TOPIC if scalar else SIGNAL_TOPIC + channel.name]
        values: list[Any] = [nothing] * len(self.ticks)
        names = topic.rows.dtype.names or ()
        last = nothing
        for tick, row in zip(topic.next_tick, topic.rows, strict=True):
            if tick >= len(values):
                break
            if scalar:
                last = float(row[names.index(channel.name)])
            elif isinstance(channel, TactileArray):
                last = Image(float(row["t_s"]), int(row["counter"]), cells_of(channel, row["cells"]))
            else:
                rows = row["values"].reshape(declared_shape(channel)).tolist()
                new = min(max(int(row["new"]), 0), len(rows))
                last = Samples(float(row["t_s"]), int(row["counter"]), new, tuple(map(tuple, rows)))
            values[tick] = last
        # An image stays until the next one; samples are new in one tick only.
        for k in range(1, len(values)):
            if values[k] is nothing and values[k - 1] is not nothing:
                value = values[k - 1]
                if isinstance(value, Samples):
                    value = Samples(value.t_s, value.counter, 0, nothing.values)
                values[k] = value
        return values

    def _rate_of_ticks(self) -> float:
        """Return the number of ticks per unit of time, from their times; 1000 where these do not increase."""
        times = self.ticks["t_s"]
        elapsed = float(times[-1] - times[0]) if len(times) else 0.0
        return (len(times) - 1) / elapsed if elapsed > 0.0 else 1000.0

    def recording(self) -> Recording:
        """Return the grasp in the form that a gripper can replay. Raises DataDamaged as `trace`."""
        with readable(f"the recording {self.path}"):
            return self._recording()

    def _recording(self) -> Recording:
        units = {name: unit for name, unit in self.units.items() if SI_UNITS.get(name) != unit}
        # An imported recording has no commands, and ends where the imported file ends.
        known = not np.isnan(self.ticks["command"]).any()
        return Recording(
            name=f"recording {self.path.name} of {self.device.name or 'an unknown gripper'}",
            readings=self.readings(),
            rate_hz=self.device.rate_hz or self._rate_of_ticks(),
            units=units,
            notes=(*self.device.notes, REPLAY_NOTE),
            commands=tuple(self.ticks["command"].tolist()) if known else None,
            has_release=known and bool((self.ticks["phase"] == Phase.RELEASE).any()),
            channels=self.channels,
            mounting=self.device.mounting,
            events=self.labelled_events(),
        )


def read_recorded(path: str | Path, *, salvage: bool = False) -> RecordedGrasp:
    """Return the grasp in a recording.

    With `salvage`, return what can be read of a file that is damaged or has no end. Without it, such a file raises
    DataDamaged. Raises ConfigError if the file cannot be opened, TooLarge if it unpacks to more than is allowed.
    """
    path = Path(path).expanduser()
    reading = _PartialGrasp(path)
    with readable(f"the recording {path}"):
        refuse_devices(path)
        if not path.exists():
            raise _missing(path)
        with path.open("rb") as file:
            damage = reading.take_all(file, salvage)
    if not salvage:
        damage = damage or reading.shortfall()
        if damage:
            raise _damaged(path, damage)
    grasp = reading.grasp(damage, salvage)
    if not salvage:
        grasp.told_events()
    return grasp


def read_first_frame(path: Path) -> Frame | None:
    """Return the first frame of a recording, reading no more of it than needed; None if it has none.

    Raises ConfigError if the file cannot be opened, DataDamaged if it cannot be read up to the first frame.
    """
    reading = _PartialGrasp(path)
    with readable(f"the recording {path}"):
        refuse_devices(path)
        with path.open("rb") as file:
            for record in reading.records(file):
                damage = reading.take(record)
                ticks = reading.bodies[TICK_TOPIC]
                if damage:
                    raise DataDamaged(f"the recording {path} is damaged: {damage}")
                if ticks:
                    return Frame(*TICK.unpack(ticks[0])[: len(Frame._fields)])
    return None


def _damaged(path: Path, problem: str) -> DataDamaged:
    return DataDamaged(
        f"the recording {path} is damaged: {problem}. `graspsense recover {path}` saves what can be read"
    )


def _missing(path: Path) -> ConfigError:
    unfinished = path.with_name(path.name + PART)
    hint = f"; {unfinished.name} was never finished: graspsense recover" if unfinished.is_file() else ""
    return ConfigError(f"there is no recording {path}{hint}")


class _PartialGrasp:
    """The parts of a recording that have been read so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, str] = {}
        self.layouts: dict[str, Topic] = {}
        self.schemas: dict[int, Schema] = {}
        self.bodies: dict[str, list[bytes]] = {TICK_TOPIC: []}
        self.next_number = dict.fromkeys(self.bodies, 0)
        self.next_tick: dict[str, list[int]] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.lost = 0
        self.base_ns: int | None = None
        self.ended = self.started = False
        # What is packed counts beside the limit: the images of a camera fill a file of that size.
        size = path.stat().st_size if path.is_file() else 0
        self._unpacked = Unpacked(f"the recording {path}", allowance=size)

    def records(self, file: BinaryIO) -> Iterator[McapRecord]:
        """Yield the records of the file. Raises TooLarge, and what the library raises on a damaged file."""
        return records_of(file, self._unpacked, largest=largest_record(), validate_crcs=True)

    def take_all(self, file: BinaryIO, salvage: bool) -> str:
        """Add all records of a file, with `salvage` also those behind a damaged chunk. Return its damage."""
        damage = ""
        try:
            for record in self.records(file):
                damage = self.take(record) or damage
                if damage and not salvage:
                    return damage
            if not damage and file.read(1):
                damage = "there is data after its end"
        except (TooLarge, MemoryError, OSError):
            raise
        except Exception as error:
            damage = damage or named(error).removesuffix(": ")
        return damage

    def take(self, record: McapRecord) -> str:
        """Add one MCAP record. Return a description of its damage, or an empty text."""
        if isinstance(record, Header):
            self.started = True
        elif isinstance(record, Chunk):
            try:
                if record.compression not in ("", "zstd"):
                    raise ValueError(f"its compression {record.compression[:20]!r} is not supported")
                for inner in records_in(record, self._unpacked):
                    self._content(inner)
            except (TooLarge, MemoryError):
                raise
            except Exception as error:
                return f"a chunk cannot be read ({named(error)})"
        elif isinstance(record, Metadata):
            self.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Message):
            raise McapError("a message is outside of any chunk")
        elif isinstance(record, Footer | DataEnd):
            self.ended = self.ended or isinstance(record, Footer)
        return ""

    def shortfall(self) -> str:
        """Return what is missing from a complete recording, or an empty text."""
        if not self.ended:
            return "it has no end"
        if self.lost:
            return f"{self.lost} messages are missing in it"
        if START not in self.metadata:
            return "it does not say how it was made, so it is not a recording of graspsense"
        return ""

    def grasp(self, damage: str, salvage: bool) -> RecordedGrasp:
        version = self.metadata.get(START, {}).get("version", str(VERSION))
        if version != str(VERSION):
            raise DataDamaged(
                f"the recording {self.path} has version {version[:20]!r}; this graspsense reads version {VERSION}"
            )
        if not self.started and not salvage:
            raise DataDamaged(f"{self.path} is not an MCAP file: {damage or 'its header is missing'}")
        with readable(f"the recording {self.path}"):
            device = DeviceRecord.from_text(self.metadata.get(DEVICE, {}).get("device", "{}"))
            topics = {
                name: TopicRows(
                    topic=topic,
                    rows=np.frombuffer(b"".join(self.bodies[name]), dtype=_row_type(topic)),
                    next_tick=tuple(self.next_tick[name]),
                )
                for name, topic in self.layouts.items()
                if self.bodies[name]
            }
            ticks = np.frombuffer(b"".join(self.bodies[TICK_TOPIC]), dtype=_TICK_ROW)
        problem = _impossible(ticks)
        if problem:
            raise DataDamaged(f"the recording {self.path} is damaged: {problem}")
        return RecordedGrasp(
            path=self.path,
            ticks=ticks,
            topics=topics,
            metadata=self.metadata,
            complete=self.ended and not damage and not self.lost,
            damage=damage,
            lost=self.lost,
            base_ns=self.base_ns,
            device=device,
        )

    def _content(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = self.schemas.get(record.schema_id)
            name = record.topic
            if name not in (TICK_TOPIC, PADS_TOPIC, SCALARS_TOPIC) and not name.startswith(SIGNAL_TOPIC):
                return  # a topic of another program
            if schema is None or record.message_encoding != "cdr":
                raise ValueError(f"the fields of {name} are not those of this version")
            if name == TICK_TOPIC:
                known = schema.data == TICK_SCHEMA[1]
            else:
                layout = Topic(name, schema.name, schema.data.decode())
                known = _is_ours(layout) and self.layouts.setdefault(name, layout) == layout
            if not known:
                raise ValueError(f"the fields of {name} are not those of this version")
            self.bodies.setdefault(name, [])
            self.next_tick.setdefault(name, [])
            self.next_number.setdefault(name, 0)
            self.topics[record.id] = name
        elif isinstance(record, Message):
            topic = self.topics.get(record.channel_id)
            if topic is None:
                return
            wire = TICK if topic == TICK_TOPIC else self.layouts[topic].wire
            size = len(CDR_HEADER) + wire.size
            if len(record.data) != size or record.data[:4] != CDR_HEADER:
                raise ValueError(f"a message of {topic} has {len(record.data)} bytes, not {size}")
            self.lost += (record.sequence - self.next_number[topic]) & 0xFFFFFFFF
            self.next_number[topic] = (record.sequence + 1) & 0xFFFFFFFF
            if topic != TICK_TOPIC:
                self.next_tick[topic].append(len(self.bodies[TICK_TOPIC]))
            if self.base_ns is None:
                (t_s,) = struct.unpack_from("<d", record.data, len(CDR_HEADER))
                self.base_ns = record.log_time - round(t_s * 1e9)
            self.bodies[topic].append(record.data[len(CDR_HEADER) :])


def _is_ours(topic: Topic) -> bool:
    """Return whether a topic has the fields that graspsense writes under its name."""
    names = [name for name, _, _ in topic.fields]
    if topic.name == PADS_TOPIC:
        if names == ["t_s", "counter", "left", "right"]:
            return topic.definition == pads_topic(topic.fields[-1][2]).definition
        return topic.definition == pads_topic_by_cell((len(names) - 2) // 2).definition
    if topic.name == SCALARS_TOPIC:
        return len(names) > 1 and all(kind == "d" and not number for _, kind, number in topic.fields)
    if names == ["t_s", "counter", "cells"]:
        shown_array(topic)
        return True
    return names == ["t_s", "counter", "new", "axes", "values"] and topic.fields[-1][1] == "d"


_KINDS: Final = {kind: np.dtype(name).newbyteorder("<") for kind, name in KINDS.items()}


def _row_type(topic: Topic) -> np.dtype[np.void]:
    return np.dtype(
        [
            (name, _KINDS[kind], (number,)) if number else (name, _KINDS[kind])
            for name, kind, number in topic.fields
        ]
    )


_TICK_ROW: Final = np.dtype(
    [(name, _KINDS[code]) for name, code in zip(TICK_FIELDS, TICK.format.removeprefix("<"), strict=True)]
)


def _impossible(ticks: NDArray[np.void]) -> str:
    """Return what no grasp can have in its ticks, or an empty text."""
    unknown = np.flatnonzero(~np.isin(ticks["phase"], [int(phase) for phase in Phase]))
    if len(unknown):
        return f"tick {unknown[0] + 1} has the phase {ticks['phase'][unknown[0]]}, which there is not"
    timeless = np.flatnonzero(~np.isfinite(ticks["t_s"]))
    if len(timeless):
        return f"tick {timeless[0] + 1} has the time {ticks['t_s'][timeless[0]]}"
    return ""
