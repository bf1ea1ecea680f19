"""Conversion of the reports of the board to numbers and back, as `specs/pr2_hid.md` defines them.

All functions are pure. Every report has 64 bytes, begins with its id and ends with a CRC-32. Anything that the document
does not allow raises `ProtocolError`.
"""

from __future__ import annotations

import math
import struct
from typing import Final, NamedTuple
from zlib import crc32

REPORT_SIZE: Final = 64
INPUT_ID: Final = 1
OUTPUT_ID: Final = 2
FEATURE_ID: Final = 3
MAGIC: Final = b"GSPR"
PROTOCOL_VERSION: Final = 1
TRANSMISSIONS: Final = ("pr2", "pr2_2009", "pr2_paper")

SLICE_CELLS: Final = 4
SLICES: Final = 11
IMAGE_CELLS: Final = SLICES * SLICE_CELLS
MAX_SAMPLES: Final = 4
LAST_IMAGE: Final = 0xFFFF
OWN_LIMIT: Final = 0xFFFFFFFF
"""The value of a limit in a command that stands for the limit of the device."""

LET_GO: Final = 1
LIMITED: Final = 2
ENCODER_FAULT: Final = 4
SAMPLES_MISSED: Final = 8
LEFT_ABSENT: Final = 16
RIGHT_ABSENT: Final = 32

NO_COMMAND: Final = 0
ACCEPTED: Final = 1
CLAMPED: Final = 2
REFUSED: Final = 3

RELEASE_KIND: Final = 0
EFFORT_KIND: Final = 1

INPUT_LAYOUT: Final = struct.Struct("<BIQiiiHHB4IHB4HBH")
OUTPUT_LAYOUT: Final = struct.Struct("<BHBiII44s")
FEATURE_LAYOUT: Final = struct.Struct("<B4sB3B16sB3HII4HB11s")
_CRC: Final = struct.Struct("<I")
_BODY: Final = REPORT_SIZE - _CRC.size

REPORT_DESCRIPTOR: Final = bytes.fromhex(
    "0600FF0901A101150026FF00750885010902953F810285020903953F910285030904953FB102C0"
)
"""Vendor page 0xFF00, one collection, three reports of 63 bytes behind their ids."""


class ProtocolError(ValueError):
    """Bytes that are not a report of this protocol, or numbers that a report cannot represent."""


class InputReport(NamedTuple):
    """Report 1; order, fields and units as in the document. `samples` are the accelerometer's words, `cells` four."""

    sequence: int
    time_us: int
    encoder_ticks: int
    velocity_mtick_s: int
    effort_un: int
    status: int
    echo: int
    samples: tuple[int, ...]
    image: int
    slice: int
    cells: tuple[int, int, int, int]
    command_result: int
    image_age_us: int


class OutputReport(NamedTuple):
    """Report 2, a command; by default one that lets go."""

    counter: int = 0
    kind: int = RELEASE_KIND
    effort_un: int = 0
    effort_limit_un: int = 0
    speed_limit_um_s: int = 0


class Identity(NamedTuple):
    """Report 3: the identity of the device and the meaning of its numbers. `transmission` names the linkage."""

    firmware: tuple[int, int, int]
    serial: str
    transmission: str
    pad_counts_per_n: int
    side_counts_per_n: int
    edge_counts_per_n: int
    effort_limit_un: int
    speed_limit_um_s: int
    report_rate_hz: int
    image_period_us: int
    watchdog_ms: int
    encoder_ticks_rev: int
    accelerometer_g: int


def encode_input(report: InputReport) -> bytes:
    """Return report 1. Raises ProtocolError for numbers that it cannot hold."""
    words = (*report.samples, 0, 0, 0, 0)[:MAX_SAMPLES]
    if len(report.samples) > MAX_SAMPLES:
        raise ProtocolError(f"a report holds {MAX_SAMPLES} accelerometer samples, not {len(report.samples)}")
    try:
        head, samples, image, cells, tail = (
            report[:7],
            report.samples,
            report[8:10],
            report.cells,
            report[11:],
        )
        body = INPUT_LAYOUT.pack(INPUT_ID, *head, len(samples), *words, *image, *cells, *tail)
    except struct.error as error:
        raise ProtocolError(f"an input report cannot hold {report}: {error}") from None
    return _sealed(body)


def decode_input(data: bytes) -> InputReport:
    """Return report 1 from its bytes. Raises ProtocolError."""
    _check(data, INPUT_ID)
    _, *head, count, s0, s1, s2, s3, image, slice_, c0, c1, c2, c3, result, age = INPUT_LAYOUT.unpack_from(
        data
    )
    if count > MAX_SAMPLES or slice_ >= SLICES or result > REFUSED:
        raise ProtocolError(
            f"input report out of range: {count} samples, slice {slice_}, command result {result}"
        )
    return InputReport._make((*head, (s0, s1, s2, s3)[:count], image, slice_, (c0, c1, c2, c3), result, age))


def encode_output(report: OutputReport) -> bytes:
    """Return report 2. Raises ProtocolError for numbers that it cannot hold."""
    if report.kind not in (RELEASE_KIND, EFFORT_KIND):
        raise ProtocolError(f"there is no command kind {report.kind}")
    try:
        return _sealed(OUTPUT_LAYOUT.pack(OUTPUT_ID, *report, b""))
    except struct.error as error:
        raise ProtocolError(f"an output report cannot hold {report}: {error}") from None


def decode_output(data: bytes) -> OutputReport:
    """Return report 2 from its bytes. Raises ProtocolError."""
    _check(data, OUTPUT_ID)
    report = OutputReport(*OUTPUT_LAYOUT.unpack_from(data)[1:-1])
    if report.kind not in (RELEASE_KIND, EFFORT_KIND):
        raise ProtocolError(f"there is no command kind {report.kind}")
    return report


def encode_identity(identity: Identity) -> bytes:
    """Return report 3. Raises ProtocolError for an identity that it cannot hold or that means nothing."""
    _check_identity(identity)
    numbers = identity[identity._fields.index("pad_counts_per_n") :]
    return _sealed(
        FEATURE_LAYOUT.pack(
            FEATURE_ID,
            MAGIC,
            PROTOCOL_VERSION,
            *identity.firmware,
            identity.serial.encode("ascii"),
            TRANSMISSIONS.index(identity.transmission),
            *numbers,
            b"",
        )
    )


def decode_identity(data: bytes) -> Identity:
    """Return report 3 from its bytes. Raises ProtocolError, which says so where it is another protocol's."""
    _check(data, FEATURE_ID)
    _, magic, version, major, minor, patch, serial, transmission, *numbers, _ = FEATURE_LAYOUT.unpack_from(
        data
    )
    if magic != MAGIC:
        raise ProtocolError(f"this is no gripper of ours: its feature report begins with {magic!r}")
    if version != PROTOCOL_VERSION:
        raise ProtocolError(
            f"the device speaks protocol version {version}, this driver version {PROTOCOL_VERSION}"
        )
    if transmission >= len(TRANSMISSIONS):
        raise ProtocolError(f"there is no transmission {transmission}")
    try:
        text = serial.rstrip(b"\0").decode("ascii")
    except UnicodeDecodeError:
        raise ProtocolError(f"serial number {serial!r} is not ASCII") from None
    names = Identity._fields[Identity._fields.index("pad_counts_per_n") :]
    identity = Identity(
        firmware=(major, minor, patch),
        serial=text,
        transmission=TRANSMISSIONS[transmission],
        **dict(zip(names, numbers, strict=True)),
    )
    _check_identity(identity)
    return identity


def micro(value: float) -> int:
    """Return a number of SI units as whole micro-units. Raises ProtocolError for what 32 bits cannot hold, NaN too."""
    if not -2147.0 <= value <= 2147.0:
        raise ProtocolError(f"{value} cannot be sent: it is not a number, or does not fit in 32 bits")
    return round(value * 1e6)


def limit(value: float) -> int:
    """Return a limit in whole micro-units, rounded down; what is too large for one is the device's own limit.

    Raises ProtocolError for NaN and below zero.
    """
    if not value >= 0.0:
        raise ProtocolError(f"{value} is not a valid limit")
    return min(math.floor(value * 1e6), OWN_LIMIT) if value < math.inf else OWN_LIMIT


def _sealed(body: bytes) -> bytes:
    return body + _CRC.pack(crc32(body))


def _check(data: bytes, report_id: int) -> None:
    if not isinstance(data, bytes | bytearray | memoryview):
        raise ProtocolError(f"report {report_id} is {data!r} instead of {REPORT_SIZE} bytes")
    if len(data) != REPORT_SIZE:
        raise ProtocolError(f"a report has {REPORT_SIZE} bytes, this one {len(data)}")
    if _CRC.unpack_from(data, _BODY)[0] != crc32(data[:_BODY]):
        raise ProtocolError("wrong CRC")
    if data[0] != report_id:
        raise ProtocolError(f"report {data[0]} where report {report_id} was expected")


def _check_identity(identity: Identity) -> None:
    if identity.transmission not in TRANSMISSIONS:
        raise ProtocolError(f"there is no transmission {identity.transmission!r}")
    serial = identity.serial
    if not (0 < len(serial) <= 16 and serial.isascii() and serial.isprintable()):
        raise ProtocolError(f"serial number {serial!r}: 1 to 16 printable ASCII characters are allowed")
    sizes = {
        "pad_counts_per_n": 16, "side_counts_per_n": 16, "edge_counts_per_n": 16, "effort_limit_un": 31,
        "speed_limit_um_s": 32, "report_rate_hz": 16, "image_period_us": 16, "watchdog_ms": 16,
        "encoder_ticks_rev": 16,
    }  # fmt: skip
    for name, bits in sizes.items():
        value = getattr(identity, name)
        if not 0 < value < 1 << bits:
            raise ProtocolError(f"{name} {value} is not within 1 and {(1 << bits) - 1}")
    if not all(0 <= part < 256 for part in (*identity.firmware, identity.accelerometer_g)):
        raise ProtocolError(
            f"firmware {identity.firmware}, accelerometer {identity.accelerometer_g} g: 0-255"
        )
