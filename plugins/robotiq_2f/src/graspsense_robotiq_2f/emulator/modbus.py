"""The server's side of Modbus RTU: requests in a stream of bytes, and the replies to them."""

from __future__ import annotations

import struct
from typing import Final

from pymodbus.framer import FramerRTU

from graspsense_robotiq_2f.emulator.hand import Hand

READ: Final = (3, 4)
WRITE: Final = 16
READ_AND_WRITE: Final = 23


def checksum(data: bytes) -> bytes:
    """Return the checksum of a frame."""
    return struct.pack(">H", FramerRTU.compute_CRC(data))


def answered(hand: Hand, address: int, data: bytes, now_s: float) -> tuple[bytes, bytes]:
    """Return the replies to the data, and the remaining data: an incomplete request waits for its end."""
    replies = b""
    while True:
        reply, remaining = _answered_first(hand, address, data, now_s)
        replies += reply
        if len(remaining) == len(data):
            return replies, remaining
        data = remaining


def _answered_first(hand: Hand, address: int, data: bytes, now_s: float) -> tuple[bytes, bytes]:
    if len(data) < 8:
        return b"", data
    lengths = {WRITE: 9 + data[6], READ_AND_WRITE: 13 + (data[10] if len(data) > 10 else 255)}
    length = lengths.get(data[1], 8)
    if len(data) < length:
        return b"", data
    frame, remaining = data[: length - 2], data[length:]
    if checksum(frame) != data[length - 2 : length]:
        return b"", b""
    if frame[0] != address:
        return b"", remaining
    body = frame[:1] + _reply(hand, frame[1:], now_s)
    return body + checksum(body), remaining


def _reply(hand: Hand, request: bytes, now_s: float) -> bytes:
    """Return the reply to a request, both without address and checksum."""
    function = request[0]
    try:
        if function in READ:
            start, count = struct.unpack(">HH", request[1:5])
            return _registers(function, hand.read(start, count, now_s))
        if function == WRITE:
            start, count = struct.unpack(">HH", request[1:5])
            hand.write(start, _values(request[6:], count), now_s)
            return request[:5]
        if function == READ_AND_WRITE:
            start, count, target, wanted = struct.unpack(">HHHH", request[1:9])
            hand.write(target, _values(request[10:], wanted), now_s)
            return _registers(function, hand.read(start, count, now_s))
    except IndexError:
        return bytes([function | 0x80, 2])
    return bytes([function | 0x80, 1])


def _values(data: bytes, count: int) -> list[int]:
    if len(data) != 2 * count:
        raise IndexError
    return list(struct.unpack(f">{count}H", data))


def _registers(function: int, values: list[int]) -> bytes:
    return struct.pack(f">BB{len(values)}H", function, 2 * len(values), *values)
