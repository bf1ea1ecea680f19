"""The emulated arm in the same process: its time passes while the driver waits, and nobody waits in fact."""

from __future__ import annotations

from typing import Final, final

from graspsense.gripper_api import LockStepDevice
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.emulator.arm import EmulatedArm
from graspsense_so101_gripper.emulator.motor import GripperMotor

EXCHANGE_S: Final = 0.001
"""Time of a request and its reply: 0.5 ms on a bus of 1 Mbaud, and the rest for the converter."""


@final
class LockStepBus(LockStepDevice[GripperMotor]):
    """The bus of an arm with these settings, as a line for `ServoBus` and as the clock. Raises ConfigError for a body.

    What it sends are the packets of the bus, as on a serial port.
    """

    def __init__(self, config: So101Config, seed: int) -> None:
        self.is_using = False
        self.arm = EmulatedArm(config, "", seed)
        super().__init__(self.arm.hand)
        self._timeout_s = config.reply_timeout_s
        self._until_s = self._due_s = 0.0
        self._coming: list[tuple[float, bytes]] = []

    def clearPort(self) -> None:  # noqa: N802
        """Forget what came before the next request."""
        self._coming = [(due_s, data) for due_s, data in self._coming if due_s > self._now_s]

    def writePort(self, packet: list[int]) -> int:  # noqa: N802
        """Send a packet, and return the number of its bytes. Raises OSError."""
        self.sleep(EXCHANGE_S)
        reply = self.arm.reply(bytes(packet), self._now_s)
        if reply is None:
            raise OSError("the connection was lost")
        # The arm takes a request after it has sent the reply to the last one.
        self._due_s = max(self._due_s, self._now_s) + reply.late_s
        self._coming.append((self._due_s, reply.data))
        return len(packet)

    def readPort(self, length: int) -> bytes:  # noqa: N802
        """Return up to `length` bytes, as soon as there are some or the time is over."""
        while self._coming and self._coming[0][0] <= max(self._until_s, self._now_s):
            due_s, data = self._coming.pop(0)
            self._now_s = max(self._now_s, due_s)
            if data:
                if data[length:]:
                    self._coming.insert(0, (due_s, data[length:]))
                return data[:length]
        self._now_s = max(self._now_s, self._until_s)
        return b""

    def setPacketTimeout(self, packet_length: int) -> None:  # noqa: N802
        """Begin to wait for a reply; how long does not depend on its length."""
        self._until_s = self._now_s + self._timeout_s

    def isPacketTimeout(self) -> bool:  # noqa: N802
        """Return whether the time of the wait is over."""
        return self._now_s >= self._until_s
