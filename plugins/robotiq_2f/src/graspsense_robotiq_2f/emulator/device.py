"""An emulated gripper as a serial port of this machine. It runs in real time, and shows faults on request."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, final

from graspsense.gripper_api import EmulatedPort, EmulatedSerial
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.fingertips import emulated_boards
from graspsense_robotiq_2f.emulator.hand import Hand
from graspsense_robotiq_2f.emulator.modbus import answered
from graspsense_robotiq_2f.emulator.ur_cap import answered as answered_by_ur_cap
from graspsense_robotiq_2f.ur_cap import PREFIX

RATE_HZ: Final = 100.0
TACTILE_TICK_S: Final = 0.001
RESTART: Final = "restart"


def emulate(config: object, wire: str, seed: int) -> EmulatedGripper:
    """Return an emulated gripper not connected yet, on a `pty` (by default) or a `socket`. Raises ConfigError."""
    assert isinstance(config, RobotiqConfig)
    return EmulatedGripper(config, wire or "pty", seed)


@final
class EmulatedGripper(EmulatedSerial[Hand]):
    """A hand behind a port, and fingertips behind one or two of their own. Unplugged, it keeps what it was asked."""

    rate_hz = RATE_HZ

    def __init__(self, config: RobotiqConfig, wire: str, seed: int) -> None:
        super().__init__(wire, config.faults, Hand(config, seed))
        self._config = config
        self._data = b""
        count = config.tactile_ports.count("emulated")
        # Felt without the lock: who unplugs may hold it, and waits for the thread that asks what is felt.
        self._boards = emulated_boards(count, lambda: self.hand.fingers.forces_n, seed=seed)
        self._tactile_ports: list[EmulatedPort] = []

    @property
    def where(self) -> str:
        """What `gripper.port` has to be, empty while it is unplugged."""
        where = super().where
        return where.replace("socket:", PREFIX) if self.wire == "ur" else where

    @property
    def tactile_where(self) -> str:
        """What `gripper.tactile_port` has to be, empty without fingertips or while it is unplugged."""
        return ",".join(port.where for port in self._tactile_ports)

    @property
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects."""
        return {**super().words, RESTART: "cut the power of the gripper for a moment"}

    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other."""
        if word == RESTART:
            with self._lock:
                self.hand.power_up()
            return
        super().tell(word)
        if word == "plug" and not self._tactile_ports:
            self._tactile_ports = [
                EmulatedPort("pty", board.heard, board.unasked, TACTILE_TICK_S) for board in self._boards
            ]
        elif word == "unplug":
            ports, self._tactile_ports = self._tactile_ports, []
            for port in ports:
                port.close()

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the reply to a request that these bytes complete."""
        data = self._data + data if data else b""
        if self.wire == "ur":
            reply, self._data = answered_by_ur_cap(self.hand, data, now_s)
        else:
            reply, self._data = answered(self.hand, self._config.address, data, now_s)
        return reply

    def details(self) -> Mapping[str, float | int | str | bool]:
        """Return whether the fingers go to a target, and the port of the fingertips."""
        return {"tactile_port": self.tactile_where, "going": self.hand.going}
