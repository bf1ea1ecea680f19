"""Reading a recording: all of it or nothing, or what a killed writer left of it.

A file is somebody else's until it was read: lengths are bounded, checksums are checked, nothing in it is run.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import zstandard
from attrs import field, frozen
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, DataEnd, Footer, Header, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.roles import Reading
from graspsense.core.signals import CELLS, NO_PADS, Frame, Pads
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
from graspsense.recording.replayable import Recording

if TYPE_CHECKING:
    from numpy.typing import NDArray

LARGEST_RECORD: Final = 1 << 26
"""No record of ours comes near it, packed or unpacked: 64 MB would be over five minutes in one chunk."""

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

    `ticks` are rows of `layout.TICK_FIELDS` in the order in which they were written, `pads` rows of
    `layout.PADS_FIELDS`, and `pads_before` says before which tick each image came. `whole` is whether the file has
    its end; where it has not, `damage` says what is wrong with it and `lost` how many messages are known to be
    missing between those that are there.
    """

    path: Path
    ticks: NDArray[np.void]
    pads: NDArray[np.void]
    pads_before: tuple[int, ...]
    metadata: Mapping[str, Mapping[str, str]]
    whole: bool
    damage: str = ""
    lost: int = 0
    base_ns: int | None = None
    """Wall clock at time 0 of the gripper's clock, None where there is no message."""
    device: Mapping[str, Any] = field(factory=dict)

    def __len__(self) -> int:
        """Return the number of ticks."""
        return len(self.ticks)

    @property
    def units(self) -> Mapping[str, str]:
        """Unit of each channel and of `t`."""
        given = self.device.get("units", {})
        return {**SI_UNITS, **(given if isinstance(given, dict) else {})}

    def trace(self) -> Trace:
        """Return the columns."""
        frames, phases, commands = [], [], []
        for row in self.ticks.tolist():
            frames.append(Frame(*row[: len(Frame._fields)]))
            phases.append(row[_PHASE])
            commands.append(row[_COMMAND])
        return trace_of(frames, phases, commands, _images(self.pads), self.units)

    def readings(self) -> tuple[Reading, ...]:
        """Return what the gripper gave, tick by tick, each with the cell image it then had."""
        images = _images(self.pads)
        readings: list[Reading] = []
        image, following = NO_PADS, 0
        for k, row in enumerate(self.ticks.tolist()):
            while following < len(images) and self.pads_before[following] <= k:
                image, following = images[following], following + 1
            readings.append(Reading(Frame(*row[: len(Frame._fields)]), image))
        return tuple(readings)

    def recording(self) -> Recording:
        """Return it as what a gripper can replay."""
        units = {name: unit for name, unit in self.units.items() if SI_UNITS.get(name) != unit}
        notes = [str(one) for one in self.device.get("notes", ())]
        return Recording(
            name=f"recording {self.path.name} of {self.device.get('name', 'an unknown gripper')}",
            readings=self.readings(),
            rate_hz=float(self.device.get("rate_hz", 0.0)) or 1000.0,
            units=units,
            notes=(
                *notes,
                "the recording goes its own way: what the controller commands has no effect on it",
            ),
        )


def read_recorded(path: str | Path, *, salvage: bool = False) -> RecordedGrasp:
    """Return the grasp in an MCAP file of ours.

    With `salvage` it is what can be read of a file that is damaged or has no end; without, such a file is refused.
    Raises ConfigError where the file cannot be read, DataDamaged.
    """
    path = Path(path).expanduser()
    reading = _Reading(path)
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
                    damage = "there is something behind its end"
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


class _Reading:
    """What was read so far."""

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
        """Take a record and return what is wrong with it."""
        if isinstance(record, Header):
            self.started = True
        elif isinstance(record, Chunk):
            try:
                for one in _unpacked(record):
                    self._content(one)
            except _DAMAGE as error:
                return f"a chunk cannot be read ({type(error).__name__}: {error})"
        elif isinstance(record, Metadata):
            self.metadata[record.name] = dict(record.metadata)
        elif isinstance(record, Message):
            raise McapError("a message outside of any chunk is none of ours")
        elif isinstance(record, Footer | DataEnd):
            self.ended = self.ended or isinstance(record, Footer)
        return ""

    def shortfall(self) -> str:
        """Return what a whole recording has and this one has not."""
        if not self.ended:
            return "it has no end"
        if self.lost:
            return f"{self.lost} messages are missing in it"
        if START not in self.metadata:
            return "it does not say what made it: it is no recording of graspsense"
        return ""

    def grasp(self, damage: str, salvage: bool) -> RecordedGrasp:
        version = self.metadata.get(START, {}).get("version", str(VERSION))
        if version != str(VERSION):
            raise DataDamaged(
                f"the recording {self.path} has version {version[:20]!r}; this graspsense reads version {VERSION}"
            )
        if not self.started and not salvage:
            raise DataDamaged(f"{self.path} is no MCAP file: {damage or 'it does not begin like one'}")
        try:
            device = json.loads(self.metadata.get(DEVICE, {}).get("device", "{}"))
            if not isinstance(device, dict):
                raise TypeError("the description of the gripper is no table")
            ticks, pads = self._rows(TICK_TOPIC), self._rows(PADS_TOPIC)
            grasp = RecordedGrasp(
                path=self.path,
                ticks=ticks,
                pads=pads,
                pads_before=tuple(self.pads_before),
                metadata=self.metadata,
                whole=self.ended and not damage and not self.lost,
                damage=damage,
                lost=self.lost,
                base_ns=self.base_ns,
                device=device,
            )
            _check_device(device)
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
                return  # a topic of somebody else's beside ours
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
    return np.dtype([(name, kinds[one]) for name, one in zip(fields, code, strict=True)])


_TICK_ROW: Final = _row_type(TICK_FIELDS, TICK.format.removeprefix("<"))
_PADS_ROW: Final = _row_type(PADS_FIELDS, PADS.format.removeprefix("<"))
_PHASE: Final = TICK_FIELDS.index("phase")
_COMMAND: Final = TICK_FIELDS.index("command")


def _unpacked(chunk: Chunk) -> Sequence[McapRecord]:
    """Return the records in a chunk. Raises ValueError, before anything large is made of a small lie."""
    if chunk.uncompressed_size > LARGEST_RECORD:
        raise ValueError(f"it claims to unpack to {chunk.uncompressed_size} bytes")
    if chunk.compression not in ("", "zstd"):
        raise ValueError(f"its compression {chunk.compression[:20]!r} is none of ours")
    try:
        if chunk.compression and zstandard.frame_content_size(chunk.data) > LARGEST_RECORD:
            raise ValueError("it would unpack to more than any chunk of ours")
        return breakup_chunk(chunk, validate_crc=True)
    except zstandard.ZstdError as error:
        raise ValueError(f"it does not unpack: {error}") from error


def _images(pads: NDArray[np.void]) -> list[Pads]:
    return [Pads(row[0], row[1], row[2 : 2 + CELLS], row[2 + CELLS :]) for row in pads.tolist()]


def _check_device(device: Mapping[str, Any]) -> None:
    float(device.get("rate_hz", 0.0))
    units, notes = device.get("units", {}), device.get("notes", [])
    if not isinstance(units, dict) or not all(isinstance(one, str) for one in units.values()):
        raise TypeError("the units of the gripper are no table of texts")
    if not isinstance(notes, list):
        raise TypeError("the notes on the gripper are no list")
