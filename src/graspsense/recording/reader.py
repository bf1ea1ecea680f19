"""Reading a recording: either completely, or, for recovery, as much of it as can be read.

Files are not trusted: lengths are bounded, checksums are verified, and nothing in a file is executed.
"""

from __future__ import annotations

import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np
import zstandard
from attrs import field, frozen
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.roles import Reading
from graspsense.core.signals import CELLS, NO_PADS, Frame, Pads, Phase
from graspsense.core.trace import SI_UNITS, Trace, trace_of
from graspsense.recording.layout import (
    CDR_HEADER,
    DEVICE,
    PADS,
    PADS_FIELDS,
    PADS_TOPIC,
    PART,
    SCHEMAS,
    START,
    TICK,
    TICK_FIELDS,
    TICK_TOPIC,
    VERSION,
)
from graspsense.recording.replayable import REPLAY_NOTE, Recording
from graspsense.recording.trial_record import DeviceRecord, TrialRecord

if TYPE_CHECKING:
    from numpy.typing import NDArray

LARGEST_RECORD: Final = 1 << 26
"""Limit on the size of a record, compressed or not; 64 MB would be a chunk of more than five minutes."""

_DAMAGE: Final = (
    McapError,
    struct.error,
    ValueError,
    KeyError,
    TypeError,
    IndexError,
    EOFError,
    ArithmeticError,
    MemoryError,
    RuntimeError,
)


@frozen(kw_only=True, eq=False)
class RecordedGrasp:
    """One recorded grasp.

    `ticks` has one row of `layout.TICK_FIELDS` per tick, in the order of writing, and `pads` one row of
    `layout.PADS_FIELDS` per pad image. `pads_before[i]` is the index of the tick that image `i` precedes.
    `complete` states whether the file has its end. If not, `damage` is the reason, and `lost` the number of messages
    known to be missing between those that were read.
    """

    path: Path
    ticks: NDArray[np.void]
    pads: NDArray[np.void]
    pads_before: tuple[int, ...]
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

    def trace(self) -> Trace:
        """Return the trace of the grasp."""
        frames, phases, commands = [], [], []
        for row in self.ticks.tolist():
            frames.append(Frame(*row[: len(Frame._fields)]))
            phases.append(row[_PHASE])
            commands.append(row[_COMMAND])
        return trace_of(frames, phases, commands, _images(self.pads), self.units)

    def readings(self) -> tuple[Reading, ...]:
        """Return the readings of the gripper, one per tick, each with its most recent pad image."""
        images = _images(self.pads)
        readings: list[Reading] = []
        image, following = NO_PADS, 0
        for k, row in enumerate(self.ticks.tolist()):
            while following < len(images) and self.pads_before[following] <= k:
                image, following = images[following], following + 1
            readings.append(Reading(Frame(*row[: len(Frame._fields)]), image))
        return tuple(readings)

    def recording(self) -> Recording:
        """Return the grasp in the form that a gripper can replay."""
        units = {name: unit for name, unit in self.units.items() if SI_UNITS.get(name) != unit}
        # An imported recording has no commands, and ends where the imported file ends.
        known = not np.isnan(self.ticks["command"]).any()
        return Recording(
            name=f"recording {self.path.name} of {self.device.name or 'an unknown gripper'}",
            readings=self.readings(),
            rate_hz=self.device.rate_hz or 1000.0,
            units=units,
            notes=(*self.device.notes, REPLAY_NOTE),
            commands=tuple(self.ticks["command"].tolist()) if known else None,
            has_release=known and bool((self.ticks["phase"] == Phase.RELEASE).any()),
        )


def read_recorded(path: str | Path, *, salvage: bool = False) -> RecordedGrasp:
    """Return the grasp in a recording.

    With `salvage`, return what can be read of a file that is damaged or has no end. Without it, such a file raises
    DataDamaged. Raises ConfigError if the file cannot be opened.
    """
    path = Path(path).expanduser()
    reading = _PartialGrasp(path)
    damage = ""
    try:
        with path.open("rb") as file:
            try:
                for record in StreamReader(
                    file, emit_chunks=True, validate_crcs=True, record_size_limit=LARGEST_RECORD
                ).records:
                    damage = reading.take(record) or damage
                    if damage and not salvage:
                        break
                if not damage and file.read(1):
                    damage = "there is data after its end"
            except _DAMAGE as error:
                damage = damage or f"{type(error).__name__}: {error}".removesuffix(": ")
    except FileNotFoundError:
        unfinished = path.with_name(path.name + PART)
        hint = f"; {unfinished.name} was never finished: graspsense recover" if unfinished.is_file() else ""
        raise ConfigError(f"there is no recording {path}{hint}") from None
    except OSError as error:
        raise ConfigError(f"the recording {path} cannot be read: {error.strerror}") from error
    if not salvage:
        damage = damage or reading.shortfall()
        if damage:
            raise DataDamaged(
                f"the recording {path} is damaged: {damage}. `graspsense recover {path}` saves what can be read"
            )
    return reading.grasp(damage, salvage)


class _PartialGrasp:
    """The parts of a recording that have been read so far."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.topics: dict[int, str] = {}
        self.schemas: dict[int, Schema] = {}
        self.bodies: dict[str, list[bytes]] = {TICK_TOPIC: [], PADS_TOPIC: []}
        self.next_number = dict.fromkeys(self.bodies, 0)
        self.pads_before: list[int] = []
        self.metadata: dict[str, dict[str, str]] = {}
        self.lost = 0
        self.base_ns: int | None = None
        self.ended = self.started = False

    def take(self, record: McapRecord) -> str:
        """Add one MCAP record. Return a description of its damage, or an empty text."""
        if isinstance(record, Header):
            self.started = True
        elif isinstance(record, Chunk):
            try:
                for inner in _unpacked(record):
                    self._content(inner)
            except _DAMAGE as error:
                return f"a chunk cannot be read ({type(error).__name__}: {error})"
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
        try:
            device = DeviceRecord.from_text(self.metadata.get(DEVICE, {}).get("device", "{}"))
            ticks, pads = self._rows(TICK_TOPIC), self._rows(PADS_TOPIC)
            grasp = RecordedGrasp(
                path=self.path,
                ticks=ticks,
                pads=pads,
                pads_before=tuple(self.pads_before),
                metadata=self.metadata,
                complete=self.ended and not damage and not self.lost,
                damage=damage,
                lost=self.lost,
                base_ns=self.base_ns,
                device=device,
            )
        except _DAMAGE as error:
            raise DataDamaged(f"the recording {self.path} is damaged: {error}") from error
        return grasp

    def _content(self, record: McapRecord) -> None:
        if isinstance(record, Schema):
            self.schemas[record.id] = record
        elif isinstance(record, Channel):
            schema = self.schemas.get(record.schema_id)
            expected = SCHEMAS.get(record.topic)
            if expected is None:
                return  # a topic of another program
            if schema is None or record.message_encoding != "cdr" or schema.data != expected[1]:
                raise ValueError(f"the fields of {record.topic} are not those of this version")
            self.topics[record.id] = record.topic
        elif isinstance(record, Message):
            topic = self.topics.get(record.channel_id)
            if topic is None:
                return
            size = len(CDR_HEADER) + (TICK if topic == TICK_TOPIC else PADS).size
            if len(record.data) != size or record.data[:4] != CDR_HEADER:
                raise ValueError(f"a message of {topic} has {len(record.data)} bytes, not {size}")
            self.lost += (record.sequence - self.next_number[topic]) & 0xFFFFFFFF
            self.next_number[topic] = (record.sequence + 1) & 0xFFFFFFFF
            if topic == PADS_TOPIC:
                self.pads_before.append(len(self.bodies[TICK_TOPIC]))
            if self.base_ns is None:
                (t_s,) = struct.unpack_from("<d", record.data, len(CDR_HEADER))
                self.base_ns = record.log_time - round(t_s * 1e9)
            self.bodies[topic].append(record.data[len(CDR_HEADER) :])

    def _rows(self, topic: str) -> NDArray[np.void]:
        dtype = _TICK_ROW if topic == TICK_TOPIC else _PADS_ROW
        return np.frombuffer(b"".join(self.bodies[topic]), dtype=dtype)


def _row_type(fields: tuple[str, ...], code: str) -> np.dtype[np.void]:
    kinds = {"d": "<f8", "q": "<i8"}
    return np.dtype([(name, kinds[letter]) for name, letter in zip(fields, code, strict=True)])


_TICK_ROW: Final = _row_type(TICK_FIELDS, TICK.format.removeprefix("<"))
_PADS_ROW: Final = _row_type(PADS_FIELDS, PADS.format.removeprefix("<"))
_PHASE: Final = TICK_FIELDS.index("phase")
_COMMAND: Final = TICK_FIELDS.index("command")


def _unpacked(chunk: Chunk) -> Sequence[McapRecord]:
    """Return the records in a chunk. Raises ValueError before a false length can allocate much memory."""
    if chunk.uncompressed_size > LARGEST_RECORD:
        raise ValueError(f"it claims to unpack to {chunk.uncompressed_size} bytes")
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"its compression {chunk.compression[:20]!r} is not supported")
    try:
        if chunk.compression and zstandard.frame_content_size(chunk.data) > LARGEST_RECORD:
            raise ValueError("it would unpack to more than the largest chunk")
        return breakup_chunk(chunk, validate_crc=True)
    except zstandard.ZstdError as error:
        raise ValueError(f"it does not unpack: {error}") from error


def _images(pads: NDArray[np.void]) -> list[Pads]:
    return [Pads(row[0], row[1], row[2 : 2 + CELLS], row[2 + CELLS :]) for row in pads.tolist()]
