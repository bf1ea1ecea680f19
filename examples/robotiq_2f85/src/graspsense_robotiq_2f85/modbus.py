"""As much of Modbus as a gripper needs: one request, one reply.

Modbus application protocol V1.1b3, Modbus over serial line V1.02. RTU frames on a serial line or through a TCP
socket, or Modbus TCP. The one function is 23, write and read registers.
"""

from __future__ import annotations

import socket
import struct
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Final, Protocol

READ_AND_WRITE: Final = 23
EXCEPTION: Final = 0x80
BAUD: Final = 115200


class NoReply(Exception):
    """No reply came in time, or an invalid one; the text describes it."""


class Line(Protocol):
    """Sends and receives bytes within a time-out."""

    def send(self, data: bytes) -> None:
        """Send all bytes, and discard those received before."""

    def receive(self, count: int) -> bytes:
        """Return this number of bytes, or fewer if no more came in time."""

    def close(self) -> None:
        """Close it."""


class SerialLine:
    """A serial port, 115200 baud, 8N1."""

    def __init__(self, port: str, timeout_s: float) -> None:
        import serial

        self._port: Any = serial.Serial(port, BAUD, timeout=timeout_s, write_timeout=timeout_s)

    def send(self, data: bytes) -> None:
        """Send all bytes, and discard those received before."""
        self._port.reset_input_buffer()
        self._port.write(data)

    def receive(self, count: int) -> bytes:
        """Return this number of bytes, or fewer if no more came in time."""
        return bytes(self._port.read(count))

    def close(self) -> None:
        """Close it."""
        self._port.close()


class SocketLine:
    """A TCP connection."""

    def __init__(self, host: str, port: int, timeout_s: float) -> None:
        self._socket = socket.create_connection((host, port), timeout=max(timeout_s, 1.0))
        self._timeout_s = timeout_s
        self._socket.settimeout(timeout_s)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def send(self, data: bytes) -> None:
        """Send all bytes, and discard those received before."""
        self._socket.setblocking(False)
        with suppress(BlockingIOError):
            while self._socket.recv(4096):
                pass
        self._socket.settimeout(self._timeout_s)
        self._socket.sendall(data)

    def receive(self, count: int) -> bytes:
        """Return this number of bytes, or fewer if no more came in time."""
        found = b""
        while len(found) < count:
            try:
                more = self._socket.recv(count - len(found))
            except TimeoutError:
                break
            if not more:
                raise ConnectionResetError("the other side closed the connection")
            found += more
        return found

    def close(self) -> None:
        """Close it."""
        self._socket.close()


def crc(data: bytes) -> bytes:
    """Return the checksum of an RTU frame, low byte first (polynomial 0xA001, from 0xFFFF)."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


class Client:
    """Writes and reads registers of one unit; `rtu` frames have an address and a checksum, else Modbus TCP's header."""

    def __init__(self, line: Line, address: int, rtu: bool) -> None:
        self._line, self._address, self._rtu = line, address, rtu
        self._transaction = 0

    def exchange(self, write: int, values: Sequence[int], read: int, count: int) -> list[int]:
        """Write the output registers and return the input registers. Raises NoReply, OSError."""
        request = struct.pack(
            f">BHHHHB{len(values)}H",
            READ_AND_WRITE,
            read,
            count,
            write,
            len(values),
            2 * len(values),
            *values,
        )
        reply = (self._over_rtu if self._rtu else self._over_tcp)(request, 2 + 2 * count)
        if reply[1] != 2 * count:
            raise NoReply(f"a reply of {reply[1]} bytes instead of {2 * count}")
        return list(struct.unpack(f">{count}H", reply[2:]))

    def close(self) -> None:
        """Close the connection."""
        self._line.close()

    def _over_rtu(self, request: bytes, length: int) -> bytes:
        frame = bytes([self._address]) + request
        self._line.send(frame + crc(frame))
        head = self._line.receive(3)
        _look(head, 3, self._address)
        rest = self._line.receive(2 if head[1] & EXCEPTION else length + 1 - 3 + 2)
        whole = head + rest
        if len(whole) < 5 or crc(whole[:-2]) != whole[-2:]:
            raise NoReply(f"a reply that is damaged on its way: {whole.hex(' ')}")
        return _plain(whole[1:-2])

    def _over_tcp(self, request: bytes, length: int) -> bytes:
        self._transaction = self._transaction % 0xFFFF + 1
        self._line.send(struct.pack(">HHHB", self._transaction, 0, len(request) + 1, self._address) + request)
        head = self._line.receive(7)
        _look(head[6:], 1, self._address)
        number, _, size, _ = struct.unpack(">HHHB", head)
        body = self._line.receive(size - 1)
        if number != self._transaction or len(body) != size - 1:
            raise NoReply(f"a reply to another request, or half of one: {(head + body).hex(' ')}")
        return _plain(body)


def _look(head: bytes, wanted: int, address: int) -> None:
    if len(head) < wanted:
        raise NoReply("no reply")
    if head[0] != address:
        raise NoReply(f"a reply from unit {head[0]} instead of {address}")


def _plain(body: bytes) -> bytes:
    if body[0] & EXCEPTION:
        raise NoReply(f"the gripper refuses the request with Modbus exception {body[1]}")
    return body


def opened(port: str, address: int, timeout_s: float) -> Client:
    """Return a client on `/dev/...`, `tcp:HOST:PORT` (Modbus TCP) or `rtu-tcp:HOST:PORT`. Raises "
    "OSError, ValueError."""
    kind, _, where = port.partition(":")
    if kind not in ("tcp", "rtu-tcp"):
        return Client(SerialLine(port, timeout_s), address, rtu=True)
    host, _, number = where.rpartition(":")
    return Client(SocketLine(host, int(number), timeout_s), address, rtu=kind == "rtu-tcp")
