"""The registers of a 2F-85 (Robotiq, 2F-85 & 2F-140 instruction manual, "Control") and the meaning of their bytes.

Three output registers from 0x03E8: action, position request, speed and force. Three input registers from 0x07D0:
status, fault and echo, position and current. Speeds go from 20 to 150 mm/s and forces from 20 to 235 N over a byte;
the current is in steps of 10 mA. The position byte is 3 open and about 230 closed, over 85 mm.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

OUTPUT: Final = 0x03E8
INPUT: Final = 0x07D0
COUNT: Final = 3

OPEN_M: Final = 0.085
OPEN_BYTE: Final = 3
CLOSED_BYTE: Final = 230
SPEEDS_M_S: Final = (0.020, 0.150)
FORCES_N: Final = (20.0, 235.0)
AMPERES_A_STEP: Final = 0.010

ACTIVE: Final = 3
MOVING, STOPPED_OPENING, STOPPED_CLOSING, THERE = range(4)
"""The meaning of the object bits."""


class Request(NamedTuple):
    """A request to the gripper, in bytes."""

    active: bool
    go: bool
    position: int
    speed: int
    force: int

    def registers(self) -> list[int]:
        """Return the output registers."""
        return [self.active << 8 | self.go << 11, self.position, self.speed << 8 | self.force]


class Status(NamedTuple):
    """The status of the gripper, in bytes and bits."""

    active: bool
    state: int
    objects: int
    fault: int
    position: int
    current: int


def request_of(registers: Sequence[int]) -> Request:
    """Return the request in these output registers."""
    action, position, both = registers
    return Request(bool(action >> 8 & 1), bool(action >> 11 & 1), position & 0xFF, both >> 8, both & 0xFF)


def status_of(registers: Sequence[int]) -> Status:
    """Return the status in these input registers."""
    first, second, third = registers
    status = first >> 8
    return Status(
        bool(status & 1), status >> 4 & 3, status >> 6 & 3, second >> 8 & 15, third >> 8, third & 0xFF
    )


def gap_of(position: int) -> float:
    """Return the gap (m) at this position byte."""
    return OPEN_M * (CLOSED_BYTE - min(max(position, OPEN_BYTE), CLOSED_BYTE)) / (CLOSED_BYTE - OPEN_BYTE)


def position_of(gap_m: float) -> int:
    """Return the position byte nearest to this gap."""
    share = 1.0 - min(max(gap_m / OPEN_M, 0.0), 1.0)
    return round(OPEN_BYTE + share * (CLOSED_BYTE - OPEN_BYTE))


def byte_of(value: float, within: tuple[float, float]) -> int:
    """Return the byte of a speed or force: the largest one whose value is not above it, or 0."""
    low, high = within
    return int(min(max((value - low) / (high - low), 0.0), 1.0) * 255.0 + 1e-9)


def value_of(byte: int, within: tuple[float, float]) -> float:
    """Return the speed or force of a byte."""
    return within[0] + (within[1] - within[0]) * byte / 255.0
