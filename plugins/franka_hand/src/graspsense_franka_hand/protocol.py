"""The network protocol of the hand, version 3: commands over TCP at port 1338, states over UDP to the host.

A message has a header with the command, its number and the length of the whole message; all numbers are
little-endian and packed. Written after the behaviour of libfranka and of franky-sim, which speak it.
"""

from __future__ import annotations

import struct
from typing import Final, NamedTuple, final

PORT: Final = 1338
VERSION: Final = 3
CONNECT, HOMING, GRASP, MOVE, STOP = range(5)
SUCCESS, FAILED, UNSUCCESSFUL, ABORTED = range(4)
INCOMPATIBLE: Final = 1
"""The status of the reply to `CONNECT` if the versions differ."""

HEADER: Final = struct.Struct("<HII")
LARGEST: Final = 256
REQUESTS: Final = {
    CONNECT: struct.Struct("<HH"),
    HOMING: struct.Struct("<"),
    GRASP: struct.Struct("<5d"),
    MOVE: struct.Struct("<2d"),
    STOP: struct.Struct("<"),
}
"""Connect: version and UDP port. Grasp: width, inner and outer tolerance, speed, force. Move: width, speed."""
_STATE: Final = struct.Struct("<IddBH")
_STATUS: Final = struct.Struct("<H")
_CONNECTED: Final = struct.Struct("<HH")


class HandRequest(NamedTuple):
    """A command with its number and its values."""

    command: int
    number: int
    values: tuple[float, ...]


class NotARequest(Exception):
    """Bytes that are no request."""


def reply(request: HandRequest, status: int) -> bytes:
    """Return the reply to a command; to a connection with the version of the protocol."""
    data = _CONNECTED.pack(status, VERSION) if request.command == CONNECT else _STATUS.pack(status)
    return HEADER.pack(request.command, request.number, HEADER.size + len(data)) + data


def state(time_ms: int, width_m: float, widest_m: float, grasped: bool, temperature_c: int) -> bytes:
    """Return a state as it is sent."""
    return _STATE.pack(time_ms & 0xFFFFFFFF, width_m, widest_m, grasped, temperature_c)


def connection(data: bytes) -> tuple[int, int] | None:
    """Return status and version of a reply to `CONNECT`; None if it is none. Raises struct.error if it is cut."""
    command, _, length = HEADER.unpack_from(data)
    if (command, length) != (CONNECT, HEADER.size + _CONNECTED.size):
        return None
    status, version = _CONNECTED.unpack_from(data, HEADER.size)
    return status, version


def request_bytes(command: int, number: int, *values: float) -> bytes:
    """Return a request as a host sends it."""
    data = REQUESTS[command].pack(*values)
    return HEADER.pack(command, number, HEADER.size + len(data)) + data


@final
class HandRequests:
    """Finds requests in a stream of bytes."""

    def __init__(self) -> None:
        self._data = b""

    def fed(self, data: bytes) -> list[HandRequest]:
        """Take bytes and return the complete requests. Raises NotARequest."""
        self._data += data
        requests = []
        while len(self._data) >= HEADER.size:
            command, number, length = HEADER.unpack_from(self._data)
            layout = REQUESTS.get(command)
            if layout is None or length != HEADER.size + layout.size:
                raise NotARequest(f"command {command} with {length} bytes")
            if len(self._data) < length:
                break
            requests.append(HandRequest(command, number, layout.unpack_from(self._data, HEADER.size)))
            self._data = self._data[length:]
        return requests
