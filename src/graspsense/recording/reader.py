"""Reading a recording: either completely, or, for recovery, as much of it as can be read.

Files are not trusted: lengths are bounded, checksums are verified, and nothing in a file is executed.
"""

from __future__ import annotations

import hashlib
import os
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

import numpy as np
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from numpy.typing import NDArray

from graspsense.core.values.errors import ConfigError, DataDamaged, TooLarge, named
from graspsense.core.values.limits import CHANNEL_NUMBERS
from graspsense.core.values.signals import Frame, Phase
from graspsense.recording.layout import (
    CDR_HEADER,
    DEVICE,
    PADS_TOPIC,
    PART,
    SCALARS_TOPIC,
    SIGNAL_TOPIC,
    START,
    TICK,
    TICK_TOPIC,
    TICKS,
    VERSION,
    Topic,
    pads_topic,
    pads_topic_by_cell,
    shown_array,
)
from graspsense.recording.mcap_records import MAGIC, records_in, records_of
from graspsense.recording.readable import readable, refuse_devices
from graspsense.recording.recorded_grasp import RecordedGrasp, TopicRows, row_type
from graspsense.recording.replayable import Recording
from graspsense.recording.trial_record import DeviceRecord
from graspsense.recording.unpacked import Unpacked


def largest_record() -> int:
    """Return the limit on the bytes of a record: 64 MB, and more where larger channels are allowed.

    A chunk ends with the message that makes it larger than 16 MB. Raises ConfigError as `CHANNEL_NUMBERS.most`.
    """
    return max(1 << 26, (1 << 25) + 24 * CHANNEL_NUMBERS.most)


def read_recorded(path: str | Path, *, salvage: bool = False, sha256: str = "") -> RecordedGrasp:
    """Return the grasp in a recording.

    With `salvage`, return what can be read of a file that is damaged or has no end. Without it, such a file raises
    DataDamaged, as does a whole file whose hash is not `sha256`, which a store has of the recording of a trial. Raises
    ConfigError if the file cannot be opened or is of another kind, TooLarge if it unpacks to more than is allowed.
    """
    path = Path(os.path.expanduser(path))
    reading = _PartialGrasp(path)
    with readable(f"the recording {path}"):
        refuse_devices(path)
        if not path.exists():
            raise _missing(path)
        with path.open("rb") as file:
            if ".mcap" not in path.name and not file.peek(len(MAGIC)).startswith(MAGIC):
                raise ConfigError(
                    f"{path} is no recording (.mcap): neither its name nor its content is that of one"
                )
            damage = reading.take_all(file, salvage)
            file.seek(0)
            replaced = sha256 and hashlib.file_digest(file, "sha256").hexdigest() != sha256
    if not salvage:
        damage = damage or reading.shortfall()
        if damage:
            raise _damaged(path, damage)
        if replaced:
            raise DataDamaged(
                f"the recording {path} is not that of its trial: another file has taken its place. Put the right one "
                "back, or set the trial aside"
            )
    grasp = reading.grasp(damage, salvage)
    if not salvage:
        grasp.told_events()
    return grasp


def read_recording(path: str) -> Recording:
    """Return the grasp in a complete recording, as a gripper can replay it. Raises as `read_recorded`."""
    return read_recorded(path).recording()


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
                    rows=np.frombuffer(b"".join(self.bodies[name]), dtype=row_type(topic)),
                    next_tick=tuple(self.next_tick[name]),
                )
                for name, topic in self.layouts.items()
                if self.bodies[name] and name != TICK_TOPIC
            }
            ticks = np.frombuffer(b"".join(self.bodies[TICK_TOPIC]), dtype=row_type(TICKS))
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
            layout = None if schema is None else Topic(name, schema.name, schema.data.decode())
            known = layout is not None and record.message_encoding == "cdr" and _is_ours(layout)
            if layout is None or not known or self.layouts.setdefault(name, layout) != layout:
                raise ValueError(f"the fields of {name} are not those of this version")
            self.bodies.setdefault(name, [])
            self.next_tick.setdefault(name, [])
            self.next_number.setdefault(name, 0)
            self.topics[record.id] = name
        elif isinstance(record, Message):
            topic = self.topics.get(record.channel_id)
            if topic is None:
                return
            size = len(CDR_HEADER) + self.layouts[topic].wire.size
            if len(record.data) != size or record.data[:4] != CDR_HEADER:
                raise ValueError(f"a message of {topic} has {len(record.data)} bytes, not {size}")
            self.lost += (record.sequence - self.next_number[topic]) & 0xFFFFFFFF
            self.next_number[topic] = (record.sequence + 1) & 0xFFFFFFFF
            self.next_tick[topic].append(len(self.bodies[TICK_TOPIC]))
            if self.base_ns is None:
                (t_s,) = struct.unpack_from("<d", record.data, len(CDR_HEADER))
                self.base_ns = record.log_time - round(t_s * 1e9)
            self.bodies[topic].append(record.data[len(CDR_HEADER) :])


def _is_ours(topic: Topic) -> bool:
    """Return whether a topic has the fields that graspsense writes under its name."""
    names = [name for name, _, _ in topic.fields]
    if topic.name == TICK_TOPIC:
        return topic.definition == TICKS.definition
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


def _impossible(ticks: NDArray[np.void]) -> str:
    """Return what no grasp can have in its ticks, or an empty text."""
    unknown = np.flatnonzero(~np.isin(ticks["phase"], [int(phase) for phase in Phase]))
    if len(unknown):
        return f"tick {unknown[0] + 1} has the phase {ticks['phase'][unknown[0]]}, which there is not"
    timeless = np.flatnonzero(~np.isfinite(ticks["t_s"]))
    if len(timeless):
        return f"tick {timeless[0] + 1} has the time {ticks['t_s'][timeless[0]]}"
    return ""
