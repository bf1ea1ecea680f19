"""The motors' side of the bus: requests in a stream of bytes, and the replies to them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from graspsense_so101_gripper.emulator.motor import EmulatedMotor

HEADER: Final = b"\xff\xff"
BROADCAST: Final = 0xFE
PING, READ, WRITE, SYNC_READ, SYNC_WRITE = 1, 2, 3, 0x82, 0x83


def checksum(body: bytes) -> int:
    """Return the checksum of a packet without its header: the complement of the sum."""
    return ~sum(body) & 0xFF


def packet(motor: int, kind: int, data: bytes = b"") -> bytes:
    """Return a packet: of a request with its instruction, of a reply with its status."""
    body = bytes((motor, len(data) + 2, kind)) + data
    return HEADER + body + bytes((checksum(body),))


class Requests:
    """Finds packets in a stream of bytes and lets the motors of a bus answer them."""

    def __init__(self, motors: Mapping[int, EmulatedMotor]) -> None:
        self._motors = motors
        self._data = b""

    def forget(self) -> None:
        """Forget an incomplete request."""
        self._data = b""

    def fed(self, data: bytes) -> bytes:
        """Take bytes, and return the replies."""
        self._data += data
        replies = b""
        while True:
            start = self._data.find(HEADER)
            self._data = self._data[start:] if start >= 0 else self._data[-1:]
            if len(self._data) < 4:
                return replies
            length = self._data[3]
            if length < 2 or self._data[2] == 0xFF:
                self._data = self._data[1:]
                continue
            if len(self._data) < 4 + length:
                return replies
            body, given = self._data[2 : 3 + length], self._data[3 + length]
            if checksum(body) != given:
                self._data = self._data[2:]
                continue
            self._data = self._data[4 + length :]
            replies += self._answer(body[0], body[2], body[3:])

    def _answer(self, target: int, instruction: int, given: bytes) -> bytes:
        if instruction == SYNC_READ and len(given) >= 2:
            return b"".join(self._read(motor, given[:2]) for motor in given[2:])
        if instruction == SYNC_WRITE and len(given) >= 2:
            size = given[1] + 1
            for start in range(2, len(given) - size + 1, size):
                self._write(given[start], given[0], given[start + 1 : start + size])
            return b""
        addressed = list(self._motors) if target == BROADCAST else [target]
        replies = [self._single(motor, instruction, given) for motor in addressed if motor in self._motors]
        return b"".join(replies) if target != BROADCAST or instruction == PING else b""

    def _single(self, motor: int, instruction: int, given: bytes) -> bytes:
        if instruction == READ:
            return self._read(motor, given)
        if instruction == WRITE and given:
            self._write(motor, given[0], given[1:])
        return packet(motor, self._motors[motor].status)

    def _read(self, motor: int, given: bytes) -> bytes:
        if motor not in self._motors or len(given) != 2:
            return b""
        return packet(motor, self._motors[motor].status, self._motors[motor].read(*given))

    def _write(self, motor: int, address: int, data: bytes) -> None:
        if motor in self._motors:
            self._motors[motor].write(address, data)
