"""An emulated gripper as a serial port of this machine. It runs in real time, and shows faults on request."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from typing import Final, final

from graspsense.gripper_api import EmulatedDevice
from graspsense_robotiq_2f.config import RobotiqConfig
from graspsense_robotiq_2f.emulator.fingertips import EmulatedFingertips, Felt
from graspsense_robotiq_2f.emulator.hand import Hand
from graspsense_robotiq_2f.emulator.modbus import answered
from graspsense_robotiq_2f.emulator.port import SerialPort
from graspsense_robotiq_2f.emulator.ur_cap import answered as answered_by_ur_cap
from graspsense_robotiq_2f.ur_cap import PREFIX

RATE_HZ: Final = 100.0
TACTILE_TICK_S: Final = 0.001
KEEP_UP_S: Final = 0.02
"""How often the fingers move on without a request, so that the next one need not wait until they have."""
MOODS: Final = {
    "well": "behave again",
    "silent": "take requests, but send no replies",
    "damaged": "flip a bit of each reply",
    "late": "send each reply late",
    "repeated": "send each reply twice",
}


def emulate(config: object, wire: str, seed: int) -> EmulatedGripper:
    """Return an emulated gripper not connected yet, on a `pty` (by default), a `socket`, or as a `ur` cap.

    Raises ConfigError.
    """
    assert isinstance(config, RobotiqConfig)
    return EmulatedGripper(config, wire or "pty", seed)


@final
class EmulatedGripper(EmulatedDevice):
    """A hand behind a port. Unplugged, it keeps its power and what it was asked."""

    rate_hz = RATE_HZ

    def __init__(self, config: RobotiqConfig, wire: str, seed: int) -> None:
        self.wire = wire
        self._config = config
        self._hand = Hand(config, seed)
        self._lock = threading.Lock()
        self._began_s = time.monotonic()
        self._data = b""
        self._port: SerialPort | None = None
        self._fingertips = (
            EmulatedFingertips(self._felt, seed=seed) if config.tactile_port == "emulated" else None
        )
        self._tactile_port: SerialPort | None = None
        self._told = self._failed = ""
        self._requests = 0

    @property
    def where(self) -> str:
        """What `gripper.port` has to be, empty while it is unplugged."""
        if self._port is None:
            return ""
        return self._port.where.replace("socket:", PREFIX) if self.wire == "ur" else self._port.where

    @property
    def tactile_where(self) -> str:
        """What `gripper.tactile_port` has to be, empty without fingertips or while it is unplugged."""
        return "" if self._tactile_port is None else self._tactile_port.where

    @property
    def body_report(self) -> Mapping[str, float | int | str | bool]:
        """What the body knows."""
        return self._hand.fingers.body.report()

    @property
    def words(self) -> Mapping[str, str]:
        """The words that `tell` understands, with their effects."""
        return {
            "plug": "plug it in, as a new port",
            "unplug": "pull the plug; the gripper keeps its power",
            **MOODS,
        }

    def tell(self, word: str) -> None:
        """Execute one of `words`. Raises KeyError for any other."""
        if word == "plug":
            if self._port is None:
                self._data = b""
                self._port = SerialPort(self.wire, self._heard, self._moved_on, KEEP_UP_S)
                if (tips := self._fingertips) is not None:
                    self._tactile_port = SerialPort("pty", tips.heard, tips.unasked, TACTILE_TICK_S)
        elif word == "unplug":
            ports = self._port, self._tactile_port
            self._port = self._tactile_port = None
            for port in ports:
                if port is not None:
                    port.close()
        else:
            self._told = {word: word for word in MOODS}[word]

    def state(self) -> Mapping[str, float | int | str | bool]:
        """Return where it is reached, and the state of its fingers."""
        with self._lock:
            if not self._failed:
                self._hand.look(self._now_s())
            return {
                "port": self.where,
                "tactile_port": self.tactile_where,
                "plugged": self._port is not None,
                "mood": self._mood_now(),
                "requests": self._requests,
                "gap_m": round(self._hand.fingers.gap_m, 5),
                "effort_n": round(self._hand.fingers.effort_n, 3),
                "going": self._hand.going,
                "failed": self._failed,
            }

    def close(self) -> None:
        """Unplug it and release the body."""
        self.tell("unplug")
        self._hand.close()

    def _now_s(self) -> float:
        return time.monotonic() - self._began_s

    def _mood_now(self) -> str:
        faults = self._config.faults
        if self._told:
            return self._told
        return faults.mood if self._active_s() >= faults.mood_at_s else "well"

    def _active_s(self) -> float:
        return self._now_s() - self._hand.active_since_s

    def _felt(self) -> Felt:
        # Not by waiting: who unplugs may hold the lock, and waits for the thread that calls this.
        return self._hand.felt

    def _moved_on(self) -> bytes:
        with self._lock:
            try:
                self._hand.look(self._now_s())
            except Exception as error:
                return self._fail(error)
        return b""

    def _fail(self, error: Exception) -> bytes:
        """End as a lost device does: the simulated fingers can be a user's code and fail."""
        self._failed = f"{type(error).__name__}: {error}"
        self.tell("unplug")
        return b""

    def _heard(self, data: bytes) -> bytes:
        with self._lock:
            if self._active_s() >= self._config.faults.unplug_at_s:
                self.tell("unplug")
                return b""
            try:
                data = self._data + data
                if self.wire == "ur":
                    reply, self._data = answered_by_ur_cap(self._hand, data, self._now_s())
                else:
                    reply, self._data = answered(self._hand, self._config.address, data, self._now_s())
            except Exception as error:
                # The simulated fingers can be a user's code and fail; the host then sees a lost device.
                self._failed = f"{type(error).__name__}: {error}"
                self.tell("unplug")
                return b""
            self._requests += bool(reply)
            mood = self._mood_now()
        if mood == "silent":
            return b""
        if mood == "damaged" and reply:
            return reply[:-3] + bytes([reply[-3] ^ 1]) + reply[-2:]
        if mood == "late":
            threading.Event().wait(self._config.faults.late_s)
        return reply * 2 if mood == "repeated" else reply
