"""An emulated hand on the network of this machine, in real time: commands by TCP at port 1338, states by UDP."""

from __future__ import annotations

import socket
from collections import deque
from collections.abc import Mapping
from contextlib import suppress
from typing import ClassVar, Final, final

from graspsense.gripper_api import EmulatedPort, EmulatedSerial, GraspsenseError
from graspsense_franka_hand import protocol
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.emulator.hand import TEMPERATURE_C, FrankaHand
from graspsense_franka_hand.orders import RATE_HZ
from graspsense_franka_hand.protocol import CONNECT, HandRequest, HandRequests, NotARequest

STEP_S: Final = 0.005
"""How often the fingers move on."""
LOCALHOST: Final = "127.0.0.1"
HOSTS: Final = tuple(f"127.0.0.{i}" for i in range(1, 33))
"""The port is fixed, so that each hand has an address of its own."""


class NoAddress(GraspsenseError):
    """Port 1338 is taken at every address of this machine."""


def emulate(config: object, wire: str, seed: int) -> EmulatedHand:
    """Return an emulated hand not connected yet. Raises ConfigError."""
    assert isinstance(config, FrankaConfig)
    return EmulatedHand(config, seed)


@final
class EmulatedHand(EmulatedSerial[FrankaHand]):
    """A hand behind port 1338 of an address of this machine. Unplugged, it keeps what it was told.

    A second host is refused. A host that goes away leaves the fingers as they are, as a real hand does.
    """

    rate_hz = RATE_HZ
    moods: ClassVar[Mapping[str, str]] = {
        "well": "behave again",
        "silent": "take commands, but send no states and no replies",
        "damaged": "cut each state, and make each reply invalid",
        "late": "send each state and reply late",
        "old": "speak another version of the protocol with whoever connects",
    }

    def __init__(self, config: FrankaConfig, seed: int) -> None:
        super().__init__("network", config.faults, FrankaHand(config, seed))
        self._states = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._late_states: deque[tuple[float, bytes]] = deque()
        self._due_s = 0.0
        self._stream, self._state_port = HandRequests(), 0

    @property
    def where(self) -> str:
        """What `gripper.host` has to be, empty while it is unplugged."""
        return super().where.removeprefix("socket:").partition(":")[0]

    def opened_port(self) -> EmulatedPort:
        """Return the port of the hand at an address where it is free. Raises NoAddress."""
        return EmulatedPort(
            self.wire, self._heard, self._moved_on, STEP_S, listener=_listener(), gone=self._host_gone
        )

    def close(self) -> None:
        """Unplug it and release the body."""
        super().close()
        self._states.close()

    def answer(self, data: bytes, now_s: float) -> bytes:
        """Return the replies to the requests that these bytes complete; bytes that are no request are forgotten."""
        if not data:
            self._forget()
            return b""
        try:
            requests = self._stream.fed(data)
        except NotARequest:
            self._stream = HandRequests()
            return b""
        replies = b""
        for request in requests:
            if request.command == CONNECT:
                replies += self._connected(request, now_s)
            elif self._state_port:
                self.hand.ask(request, now_s)
        return replies + self._ended()

    def unasked(self, now_s: float) -> bytes:
        """Send the states that are due, and return the replies to the commands that have ended."""
        mood = self._mood_at(now_s)
        if self._state_port and now_s >= self._due_s:
            self._due_s = max(self._due_s + 1.0 / RATE_HZ, now_s)
            hand = self.hand
            data = protocol.state(
                round(now_s * 1e3), hand.width_m, hand.widest_m, hand.grasped, TEMPERATURE_C
            )
            late_s = self._faults.late_s if mood == "late" else 0.0
            if mood != "silent":
                self._late_states.append((now_s + late_s, data[:-3] if mood == "damaged" else data))
        while self._late_states and self._late_states[0][0] <= now_s:
            with suppress(OSError):
                self._states.sendto(self._late_states.popleft()[1], (LOCALHOST, self._state_port))
        return self._ended()

    def details(self) -> Mapping[str, float | int | str | bool]:
        """Return where it is reached, and the state of its fingers."""
        hand = self.hand
        return {
            "host": self.where,
            "width_m": round(hand.width_m, 5),
            "grasped": hand.grasped,
            "pressing": hand.pressing,
            "refused_hosts": 0 if self._port is None else self._port.refused,
        }

    def _connected(self, request: HandRequest, now_s: float) -> bytes:
        version, port = map(int, request.values)
        if version != protocol.VERSION or self._mood_at(now_s) == "old":
            return protocol.reply(request, protocol.INCOMPATIBLE)
        self._state_port = port
        return protocol.reply(request, protocol.SUCCESS)

    def _ended(self) -> bytes:
        return b"".join(protocol.reply(request, status) for request, status in self.hand.ended())

    def _host_gone(self) -> None:
        with self._lock:
            self._forget()

    def _forget(self) -> None:
        """Forget the host, which hears of nothing any more."""
        self._stream, self._state_port = HandRequests(), 0
        self._late_states.clear()
        self.hand.abort()
        self.hand.ended()


def _listener() -> socket.socket:
    """Return a socket at the port of the hand, at the first address of this machine where it is free."""
    for address in HOSTS:
        with suppress(OSError):
            return socket.create_server((address, protocol.PORT), backlog=4)
    raise NoAddress(f"port {protocol.PORT} is taken at {HOSTS[0]} to {HOSTS[-1]}: end another emulated hand")
