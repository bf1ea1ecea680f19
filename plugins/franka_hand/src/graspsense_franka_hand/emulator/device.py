"""An emulated hand on the network of this machine. It runs in real time, and shows faults on request."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, final

from graspsense.gripper_api import EmulatedDevice
from graspsense_franka_hand.config import FrankaConfig
from graspsense_franka_hand.emulator.hand import FrankaHand
from graspsense_franka_hand.emulator.server import HandServer, real_time
from graspsense_franka_hand.orders import RATE_HZ


def emulate(config: object, wire: str, seed: int) -> EmulatedHand:
    """Return an emulated hand not connected yet. Raises ConfigError."""
    del wire
    assert isinstance(config, FrankaConfig)
    return EmulatedHand(config, seed)


@final
class EmulatedHand(EmulatedDevice):
    """A hand behind port 1338 of an address of this machine. Unplugged, it keeps what it was told."""

    wire = "network"
    rate_hz = RATE_HZ
    moods: ClassVar[Mapping[str, str]] = {
        "well": "behave again",
        "silent": "take commands, but send no states and no replies",
        "damaged": "cut each state, and make each reply invalid",
        "late": "send each state and reply late",
        "old": "speak another version of the protocol with whoever connects",
    }

    def __init__(self, config: FrankaConfig, seed: int) -> None:
        self._config = config
        self.hand = FrankaHand(config, seed)
        self._clock = real_time()
        self._server: HandServer | None = None
        self._failed = ""

    @property
    def where(self) -> str:
        """What `gripper.host` has to be, empty while it is unplugged."""
        return "" if self._server is None else self._server.where

    def plug(self) -> None:
        """Plug it in, unless it is. Raises NoAddress if its port is taken everywhere."""
        if self._server is None:
            self._server = HandServer(self.hand, self._mood, self._config.faults.late_s, self._clock)

    def unplug(self) -> None:
        """Pull the plug, unless it is pulled."""
        server, self._server = self._server, None
        if server is not None:
            server.close()
            self._failed = self._failed or server.failed

    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return where it is reached, and the state of its fingers."""
        server = self._server
        return {
            "host": self.where,
            "plugged": server is not None,
            "mood": self._mood(),
            "width_m": round(self.hand.width_m, 5),
            "grasped": self.hand.grasped,
            "effort_n": round(self.hand.fingers.effort_n, 3),
            "pressing": self.hand.pressing,
            "refused_hosts": 0 if server is None else server.refused_hosts,
            "failed": self._failed or ("" if server is None else server.failed),
        }

    def close(self) -> None:
        """Unplug it and release the body."""
        self.unplug()
        self.hand.close()

    def _mood(self) -> str:
        return self._told or self._config.faults.mood_at(self._clock())
