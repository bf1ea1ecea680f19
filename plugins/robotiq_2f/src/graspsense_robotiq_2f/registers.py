"""The registers of the grippers (Robotiq instruction manuals, "Control") and the meaning of their bytes.

Three output registers from 0x03E8: action, position request, speed and force. Three input registers from 0x07D0:
status, fault and echo, position and current. Speed and force go from least to greatest over a byte;
the current is in steps of 10 mA.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Final, NamedTuple

from graspsense.gripper_api import StatusBit

OUTPUT: Final = 0x03E8
INPUT: Final = 0x07D0
COUNT: Final = 3

AMPERES_A_STEP: Final = 0.010

ACTIVE: Final = 3
MOVING, STOPPED_OPENING, STOPPED_CLOSING, THERE = range(4)
"""The meaning of the object bits."""


class GripperModel(NamedTuple):
    """A model of gripper: its stroke, the position bytes at both ends, and its least and greatest speed and force."""

    name: str
    stroke_m: float
    open_byte: int
    closed_byte: int
    speeds_m_s: tuple[float, float]
    forces_n: tuple[float, float]

    @property
    def step_m(self) -> float:
        """The change of the gap for one step of the position byte."""
        return self.stroke_m / (self.closed_byte - self.open_byte)

    def gap_m(self, position: int) -> float:
        """Return the gap at this position byte."""
        return self.step_m * (self.closed_byte - min(max(position, self.open_byte), self.closed_byte))

    def position(self, gap_m: float) -> int:
        """Return the position byte nearest to this gap."""
        return round(self.closed_byte - min(max(gap_m, 0.0), self.stroke_m) / self.step_m)


MODELS: Final = {
    "2f-85": GripperModel(
        name="Robotiq 2F-85",
        stroke_m=0.085,
        open_byte=3,
        closed_byte=230,
        speeds_m_s=(0.020, 0.150),
        forces_n=(20.0, 235.0),
    ),
    "2f-140": GripperModel(
        name="Robotiq 2F-140",
        stroke_m=0.140,
        open_byte=3,
        closed_byte=230,
        speeds_m_s=(0.030, 0.250),
        forces_n=(10.0, 125.0),
    ),
    "hand-e": GripperModel(
        name="Robotiq Hand-E",
        stroke_m=0.050,
        open_byte=0,
        closed_byte=255,
        speeds_m_s=(0.020, 0.150),
        forces_n=(20.0, 185.0),
    ),
}


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
    go: bool
    state: int
    objects: int
    fault: int
    position: int
    current: int


def request_of(registers: Sequence[int]) -> Request:
    """Return the request in these output registers."""
    action, position, both = registers
    return Request(
        active=bool(action >> 8 & 1),
        go=bool(action >> 11 & 1),
        position=position & 0xFF,
        speed=both >> 8,
        force=both & 0xFF,
    )


def status_of(registers: Sequence[int]) -> Status:
    """Return the status in these input registers."""
    state, echo, measured = registers
    status = state >> 8
    return Status(
        active=bool(status & 1),
        go=bool(status >> 3 & 1),
        state=status >> 4 & 3,
        objects=status >> 6 & 3,
        fault=echo >> 8 & 15,
        position=measured >> 8,
        current=measured & 0xFF,
    )


def byte_of(value: float, within: tuple[float, float]) -> int:
    """Return the byte of a speed or force: the largest one whose value is not above it, or 0."""
    low, high = within
    return int(min(max((value - low) / (high - low), 0.0), 1.0) * 255.0 + 1e-9)


def value_of(byte: int, within: tuple[float, float]) -> float:
    """Return the speed or force of a byte."""
    return within[0] + (within[1] - within[0]) * byte / 255.0


_CODES: Final = {
    0x05: ("not activated", "it has to be activated again before it moves", 0.1),
    0x07: ("activation bit missing", "it has to be activated before it moves", 0.1),
    0x08: ("too hot", "its temperature is above 85 degrees Celsius: let it cool down", inf),
    0x09: ("no communication", "it got no command for a second", 0.1),
    0x0A: ("voltage too low", "its supply is below the least voltage", 0.0),
    0x0B: ("automatic release", "an emergency release is in progress", 0.0),
    0x0C: ("internal fault", "it has to be restarted", 0.0),
    0x0D: ("activation fault", "its activation met an obstacle: remove it, and restart the gripper", 0.0),
    0x0E: ("overcurrent", "its motor took too much current", 0.0),
    0x0F: ("released by itself", "an emergency release was completed: activate it again", 0.0),
}
"""Each code with its name, what follows, and the time (s) for which a grasp endures it."""

STATUS_BITS: Final = tuple(
    StatusBit(mask=1 << code, name=name, meaning=meaning, limit_s=limit_s)
    for code, (name, meaning, limit_s) in _CODES.items()
)


def bit_of(code: int) -> int:
    """Return the status bit of a fault code; 0 without a fault."""
    return 1 << code if code else 0
