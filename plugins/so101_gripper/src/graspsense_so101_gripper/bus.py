"""The serial bus of an arm: reads and writes of one motor, by the packets of feetech-servo-sdk.

The port of that package waits in a busy loop, keeps what came late, and lets another program open the port. Its packet
handler takes any object with the methods of a port: here one that waits without work, forgets old bytes, and locks.

A reply does not say which request it answers. The length of a read therefore differs from that of the reads before, so
that a late or repeated reply is known by its length.
"""

from __future__ import annotations

import select
import time
from collections.abc import Callable
from contextlib import closing, suppress
from typing import Any, Final, final

from graspsense.gripper_api import why_not_opened
from graspsense_so101_gripper.emulator.lock_step import LockStepBus
from graspsense_so101_gripper.registers import STATE, MotorRequest, motor_state

BAUD: Final = 1_000_000
LENGTHS: Final = 4
"""How many lengths a read has in turn."""
OVERHEAD: Final = 2
"""Bytes that the length of a reply counts besides its data."""


class NoStatusPacket(Exception):
    """No reply came in time, or an invalid one; the text describes it."""


class SerialLine:
    """What the packet handler of feetech-servo-sdk needs of a port. Raises OSError if it cannot be opened."""

    def __init__(self, port: str, timeout_s: float) -> None:
        import serial

        self.is_using = False
        self._timeout_s = timeout_s
        self._until_s = 0.0
        self._serial: Any = serial.Serial(port, BAUD, timeout=0, write_timeout=timeout_s, exclusive=True)

    def clearPort(self) -> None:  # noqa: N802
        """Forget what came before the next request."""
        # Not by flushing, which raises no OSError where the port is gone.
        self._serial.read(self._serial.in_waiting)

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        """Send a packet, and return the number of its bytes."""
        return int(self._serial.write(bytes(packet)))

    def readPort(self, length: int) -> bytes:  # noqa: N802
        """Return up to `length` bytes, as soon as there are some or the time is over."""
        left_s = max(self._until_s - time.monotonic(), 0.0)
        if not select.select([self._serial.fileno()], [], [], left_s)[0]:
            return b""
        return bytes(self._serial.read(length))

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802
        """Begin to wait for a reply; how long does not depend on its length."""
        self._until_s = time.monotonic() + self._timeout_s

    def isPacketTimeout(self) -> bool:  # noqa: N802
        """Return whether the time of the wait is over."""
        return time.monotonic() >= self._until_s

    def close(self) -> None:
        """Close the port."""
        with suppress(OSError):
            self._serial.close()


@final
class ServoBus:
    """A bus at a serial port, or at this line. Raises OSError if it cannot be opened, with the reason in words."""

    def __init__(self, port: str, timeout_s: float, line: LockStepBus | None = None) -> None:
        from scservo_sdk import PacketHandler

        self._requests = 0
        self._handler: Any = PacketHandler(0)
        try:
            self._line = line or SerialLine(port, timeout_s)
        except (OSError, ValueError) as error:
            raise OSError(why_not_opened(port)) from error

    def read(self, motor: int, address: int, count: int) -> bytes:
        """Return `count` bytes of a motor's memory. Raises NoStatusPacket, OSError."""
        self._requests += 1
        length = count + self._requests % LENGTHS
        return self._reply(motor, length, lambda: self._handler.readTx(self._line, motor, address, length))[
            :count
        ]

    def write(self, motor: int, address: int, data: bytes) -> None:
        """Write into a motor's memory. Raises NoStatusPacket, OSError."""

        def send() -> Any:
            result = self._handler.writeTxOnly(self._line, motor, address, len(data), list(data))
            self._line.setPacketTimeout(0)
            return result

        self._reply(motor, 0, send)

    def close(self) -> None:
        """Close the port."""
        self._line.close()

    def _reply(self, motor: int, length: int, send: Callable[[], Any]) -> bytes:
        """Return the data of the reply to a request. Raises NoStatusPacket, OSError."""
        from scservo_sdk import COMM_SUCCESS

        self._line.is_using = False
        if send() != COMM_SUCCESS:
            raise NoStatusPacket("the request could not be sent")
        while True:
            packet, result = self._handler.rxPacket(self._line)
            if result != COMM_SUCCESS:
                raise NoStatusPacket("no reply, or a damaged one")
            if packet[2] == motor and packet[3] == length + OVERHEAD:
                return bytes(packet[5 : 5 + length])
            # A reply of another motor, or to an earlier request.


def stop(port: str, motor: int, timeout_s: float, *earlier: int) -> None:
    """Let the motor of a killed program stay where it is, and ask it for what it was asked `earlier`.

    Raises OSError, NoStatusPacket.
    """
    with closing(ServoBus(port, timeout_s)) as bus:
        position = motor_state(bus.read(motor, *STATE)).position
        bus.write(motor, STATE[0], MotorRequest(*earlier).staying_at(position).written())
