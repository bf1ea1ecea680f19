"""The packets of TSF-85 fingertips: start byte, a byte that is not used, command, length, and tagged fields.

A field has a byte of kind (upper half) and finger (bits 2 and 3), and big-endian numbers. Written after Robotiq's
`tactile_sensors` and the package pyrobotiqtactile.
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple, final

START: Final = 0x9A
HEADER: Final = 4
READ: Final = 0x61
AUTOSEND: Final = (0x58, 0x59)
VERSION: Final = 0xE3
FINGERS: Final = 2
ROWS, COLUMNS = 7, 4
CELLS: Final = ROWS * COLUMNS
PRESSURE, DYNAMIC, ACCELERATION, GYROSCOPE, MAGNETIC, TEMPERATURE, TIMESTAMP = range(0x10, 0x80, 0x10)

_LAYOUTS: Final = {
    PRESSURE: struct.Struct(f">{CELLS}H"),
    DYNAMIC: struct.Struct(">h"),
    ACCELERATION: struct.Struct(">3h"),
    GYROSCOPE: struct.Struct(">3h"),
    MAGNETIC: struct.Struct(">3h"),
    TEMPERATURE: struct.Struct(">h"),
    TIMESTAMP: struct.Struct(">Q"),
}


class Field(NamedTuple):
    """The numbers of one kind from one finger."""

    kind: int
    finger: int
    values: tuple[int, ...]


def packet(command: int, data: bytes = b"") -> bytes:
    """Return a packet of this command."""
    return bytes((START, 0, command, len(data))) + data


START_SENDING: Final = packet(AUTOSEND[0], bytes((1,)))
"""Asks for a packet each millisecond."""
STOP_SENDING: Final = packet(AUTOSEND[0], bytes((0,)))


def encoded(fields: list[Field]) -> bytes:
    """Return the packet with these fields."""
    return packet(
        READ,
        b"".join(
            bytes((kind | finger << 2,)) + _LAYOUTS[kind].pack(*values) for kind, finger, values in fields
        ),
    )


def decoded(data: bytes) -> list[Field] | None:
    """Return the fields of a packet's data; None if it is damaged."""
    fields, position = [], 0
    while position < len(data):
        kind, finger = data[position] & 0xF0, data[position] >> 2 & 3
        layout = _LAYOUTS.get(kind)
        position += 1
        if layout is None or finger >= FINGERS or position + layout.size > len(data):
            return None
        fields.append(Field(kind, finger, layout.unpack_from(data, position)))
        position += layout.size
    return fields


@final
class Packets:
    """Finds packets in a stream of bytes. There is no checksum: a damaged one is known by its fields only."""

    def __init__(self) -> None:
        self._data = b""

    def fed(self, data: bytes) -> list[tuple[int, bytes]]:
        """Take bytes and return the complete packets, each with its command and data."""
        self._data += data
        packets: list[tuple[int, bytes]] = []
        while True:
            start = self._data.find(START)
            if start < 0:
                self._data = b""
                return packets
            self._data = self._data[start:]
            if len(self._data) < HEADER or len(self._data) < HEADER + self._data[3]:
                return packets
            end = HEADER + self._data[3]
            packets.append((self._data[2], self._data[HEADER:end]))
            self._data = self._data[end:]
