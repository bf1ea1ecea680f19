"""A Robotiq 2F-85 on a serial port: a gripper that closes by itself, in about a hundred lines."""

from __future__ import annotations

import struct
import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from math import inf
from typing import Any, Final, final

from attrs import frozen

from graspsense.gripper_api import Polling
from graspsense.plugin_api import (
    NO_PADS,
    POSITION,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    NoDevice,
    Pads,
    Reading,
    SensorBackend,
    setting,
)

RATE_HZ: Final = 100.0
OPEN_M, OPEN_BYTE, CLOSED_BYTE = 0.085, 3, 230
STEP_M: Final = OPEN_M / (CLOSED_BYTE - OPEN_BYTE)
SPEEDS_M_S, FORCES_N = (0.020, 0.150), (20.0, 235.0)
NEWTONS_A_STEP: Final = 1.5
"""Force for a step of the current, 10 mA: an assumption, which the manual does not give."""
EXCHANGE: Final = struct.Struct(">BBHHHHBBxxBBB")
"""Modbus function 23 of unit 9: read three registers from 0x07D0, write three from 0x03E8."""


@frozen(kw_only=True)
class Robotiq2F85Config:
    """The keys of [gripper]."""

    port: str = setting(default="/dev/ttyUSB0", meaning="Serial port.")
    reply_timeout_s: float = setting(default=0.1, unit="s", above=0.0, meaning="Longest wait for a reply.")


def crc(data: bytes) -> bytes:
    """Return the checksum of a Modbus RTU frame."""
    value = 0xFFFF
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ 0xA001 if value & 1 else value >> 1
    return struct.pack("<H", value)


def byte_of(value: float, within: tuple[float, float]) -> int:
    """Return the byte of a speed or force, not above it."""
    return int(min(max((value - within[0]) / (within[1] - within[0]), 0.0), 1.0) * 255.0)


@final
class Robotiq2F85(SensorBackend[Robotiq2F85Config]):
    """Each read is one exchange: the request of the last command, and the status."""

    channels = (
        Channel("gap", "m", RATE_HZ),
        Channel("velocity", "m/s", RATE_HZ),
        Channel("effort", "N", RATE_HZ),
    )
    accepts = ("position",)
    closes_itself: Mapping[str, str] = {"position": "the target, with its speed and force"}
    least_force_n = FORCES_N[0]
    least_step_m = STEP_M
    command_delay_s = 0.02
    _port: Any = None
    _asked = (0, 0, 0, 0)

    def open(self, seed: int) -> DeviceInfo:
        """Open the port and activate the gripper, which opens and closes once. Raises NoDevice."""
        del seed
        import serial

        self.close()
        config = self.config
        try:
            self._port = serial.Serial(config.port, 115200, timeout=config.reply_timeout_s)
            self._asked = (0, 0, 0, 0)
            self._exchange()
            self._asked = (1, 0, 0, 0)
            until_s = time.monotonic() + 5.0
            while self._exchange()[0] >> 4 & 3 != 3:
                if time.monotonic() > until_s:
                    raise DeviceLost("it is not active after 5 s")
        except (OSError, DeviceLost) as error:
            self.close()
            raise NoDevice(
                f"no 2F-85 at {config.port}: {error}. Look at gripper.port and its power"
            ) from error
        self._polling = Polling(RATE_HZ)
        return DeviceInfo(
            name="Robotiq 2F-85",
            clock="device",
            simulated=False,
            rate_hz=RATE_HZ,
            effort_limit_n=FORCES_N[1],
            speed_limit_m_s=SPEEDS_M_S[1],
            opening=Command(POSITION, OPEN_M, inf, 0.05),
            relaxed=Command(POSITION, OPEN_M, inf, 0.05),
        )

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next multiple of 10 ms, then exchange. Raises DeviceLost."""
        if not self._polling.wait(timeout_s):
            return None
        status = self._exchange()
        gap_m = STEP_M * (CLOSED_BYTE - min(max(status[4], OPEN_BYTE), CLOSED_BYTE))
        return Reading(self._polling.frame(gap_m, status[5] * NEWTONS_A_STEP), NO_PADS)

    def apply(self, command: Command) -> None:
        """Keep the request of this command for the next exchange."""
        _, gap_m, effort_n, speed_m_s = command
        position = round(CLOSED_BYTE - min(max(gap_m, 0.0), OPEN_M) / STEP_M)
        self._asked = (9, position, byte_of(speed_m_s, SPEEDS_M_S), byte_of(effort_n, FORCES_N))

    def tare(self, images: Sequence[Pads]) -> None:
        """Do nothing: there are no pads."""

    def close(self) -> None:
        """Stop the fingers, and close the port."""
        port = self._port
        if port is not None:
            self._asked = (1, *self._asked[1:])
            with suppress(OSError, DeviceLost):
                self._exchange()
            self._port = None
            port.close()

    def _exchange(self) -> bytes:
        """Return the six bytes of status, position and current. Raises DeviceLost."""
        request = EXCHANGE.pack(9, 23, 0x07D0, 3, 0x03E8, 3, 6, self._asked[0], *self._asked[1:])
        try:
            self._port.read(self._port.in_waiting)  # what came late
            self._port.write(request + crc(request))
            reply = self._port.read(11)
        except OSError as error:
            raise DeviceLost(f"the 2F-85 at {self.config.port} is gone: {error}") from error
        if len(reply) != 11 or crc(reply[:-2]) != reply[-2:]:
            raise DeviceLost(f"the 2F-85 at {self.config.port} gives no reply, or a damaged one")
        return bytes(reply[3:9])
