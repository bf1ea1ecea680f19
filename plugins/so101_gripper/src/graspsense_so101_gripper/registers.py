"""The registers of an STS3215 (Feetech's memory table of the STS series) and the meaning of their numbers.

Numbers have their low byte first. Of a signed one, a bit is the sign and the bits below it are the size.
"""

from __future__ import annotations

from math import inf
from typing import Final, NamedTuple

from graspsense.gripper_api import StatusBit

MODEL_NUMBER: Final = 777
STEPS: Final = 4096
"""Steps of a turn."""
FULL_LOAD: Final = 1000
"""Load or torque limit of the whole stall torque."""
AMPERES_A_STEP: Final = 0.0065
VOLTS_A_STEP: Final = 0.1
KELVIN: Final = 273.15


class Register(NamedTuple):
    """Where a number is, how many bytes it has, and which bit is its sign."""

    address: int
    size: int
    sign_bit: int | None = None

    def number(self, memory: bytes | bytearray, start: int = 0) -> int:
        """Return the number in a memory that begins at the address `start`."""
        offset = self.address - start
        value = int.from_bytes(memory[offset : offset + self.size], "little")
        if self.sign_bit is None:
            return value
        size = value & (1 << self.sign_bit) - 1
        return -size if value >> self.sign_bit & 1 else size

    def written(self, number: int) -> bytes:
        """Return the bytes of a number."""
        if self.sign_bit is not None and number < 0:
            number = -number | 1 << self.sign_bit
        return number.to_bytes(self.size, "little")


REGISTERS: Final = {
    "firmware_major_version": Register(0, 1),
    "firmware_minor_version": Register(1, 1),
    "model_number": Register(3, 2),
    "id": Register(5, 1),
    "min_position_limit": Register(9, 2),
    "max_position_limit": Register(11, 2),
    "max_torque_limit": Register(16, 2),
    "homing_offset": Register(31, 2, 11),
    "operating_mode": Register(33, 1),
    "torque_enable": Register(40, 1),
    "acceleration": Register(41, 1),
    "goal_position": Register(42, 2, 15),
    "goal_time": Register(44, 2),
    "goal_velocity": Register(46, 2, 15),
    "torque_limit": Register(48, 2),
    "lock": Register(55, 1),
    "present_position": Register(56, 2, 15),
    "present_velocity": Register(58, 2, 15),
    "present_load": Register(60, 2, 10),
    "present_voltage": Register(62, 1),
    "present_temperature": Register(63, 1),
    "status": Register(65, 1),
    "moving": Register(66, 1),
    "present_current": Register(69, 2),
}
"""The registers that are used, under the names of the memory table."""

IDENTITY: Final = 0, 34
"""First address and number of bytes of what a motor keeps without power, up to its mode."""
STATE: Final = 40, 31
"""Those of what it was asked and of what it measures, up to the current: one read has it all."""


class MotorRequest(NamedTuple):
    """What the motor is asked: neighbouring registers that are written at once."""

    torque_enable: int
    acceleration: int
    goal_position: int
    goal_time: int
    goal_velocity: int
    torque_limit: int

    def staying_at(self, position: int) -> MotorRequest:
        """Return the request for a motor that stays at this position."""
        return self._replace(goal_position=position, goal_time=0)

    def written(self) -> bytes:
        """Return the bytes from the first of these registers on."""
        return b"".join(REGISTERS[name].written(value) for name, value in self._asdict().items())


class MotorState(NamedTuple):
    """What one read says of a motor."""

    asked: MotorRequest
    position: int
    velocity: int
    load: int
    voltage: int
    temperature: int
    status: int
    current: int


def motor_state(memory: bytes) -> MotorState:
    """Return the state in the bytes of `STATE`."""
    start = STATE[0]
    measured = ("position", "velocity", "load", "voltage", "temperature", "current")
    return MotorState(
        asked=MotorRequest(*(REGISTERS[name].number(memory, start) for name in MotorRequest._fields)),
        status=REGISTERS["status"].number(memory, start),
        **{name: REGISTERS[f"present_{name}"].number(memory, start) for name in measured},
    )


STATUS_BITS: Final = (
    StatusBit(mask=1, name="voltage", meaning="its supply is outside of its limits", limit_s=0.0),
    StatusBit(mask=2, name="angle sensor", meaning="its position cannot be trusted", limit_s=0.0),
    StatusBit(mask=4, name="too hot", meaning="it is hotter than its limit: let it cool down", limit_s=0.5),
    StatusBit(mask=8, name="overcurrent", meaning="its current is above its limit", limit_s=0.5),
    StatusBit(
        mask=32,
        name="overload",
        meaning="it pushed for too long, and lowers its torque by itself",
        limit_s=inf,
    ),
)
