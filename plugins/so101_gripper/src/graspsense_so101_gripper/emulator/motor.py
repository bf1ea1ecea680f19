"""A motor in software: its memory, and for that of the gripper the body that it moves."""

from __future__ import annotations

from math import inf
from typing import Final

from graspsense.gripper_api import EmulatedFingers, FingerTarget
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.jaw import Jaw, opened_at
from graspsense_so101_gripper.registers import AMPERES_A_STEP, FULL_LOAD, REGISTERS, VOLTS_A_STEP

SIZE: Final = 256
FASTEST: Final = 3000
"""Speed (steps/s) of a goal without one."""
CLOSED: Final = 1600
OFFSET: Final = -120
"""Closed position and offset of the emulated gripper."""
VOLTS: Final = 7.4
CELSIUS: Final = 30
DEAD_STEPS: Final = 1
"""Distance from its goal at which the motor does not push."""
MOVING_STEPS_S: Final = 5.0
GEARS: Final = {"coulomb_n": 1.5, "breakaway_n": 2.0, "coulomb_spread_n": 0.1}
"""Friction (N) of the simulator's body where the settings give none: that of a geared motor, an assumption."""


class EmulatedMotor:
    """A motor that is where it is asked to be, and moves nothing."""

    def __init__(self, number: int, model_number: int) -> None:
        self._memory = bytearray(SIZE)
        self.status = 0
        self.writes = 0
        """The number of writes into its memory."""
        for name, value in (
            ("firmware_major_version", 3),
            ("firmware_minor_version", 10),
            ("model_number", model_number),
            ("id", number),
            ("max_position_limit", 4095),
            ("max_torque_limit", FULL_LOAD),
            ("goal_position", 2048),
            ("present_position", 2048),
        ):
            self.put(name, value)
        self.power_up()

    def number(self, name: str) -> int:
        """Return the number in a register."""
        return REGISTERS[name].number(self._memory)

    def put(self, name: str, value: int) -> None:
        """Set the number in a register."""
        register = REGISTERS[name]
        self._memory[register.address : register.address + register.size] = register.written(value)

    def power_up(self) -> None:
        """Have what a motor has after its power came: no torque, and the limits that it keeps."""
        for name in ("torque_enable", "acceleration", "goal_time", "goal_velocity"):
            self.put(name, 0)
        self.put("torque_limit", self.number("max_torque_limit"))
        self.put("lock", 1)
        self.put("present_voltage", round(VOLTS / VOLTS_A_STEP))
        self.put("present_temperature", CELSIUS)

    def read(self, address: int, count: int) -> bytes:
        """Return bytes of the memory; beyond its end 0."""
        return bytes(self._memory[address : address + count]).ljust(count, b"\0")

    def write(self, address: int, data: bytes) -> None:
        """Write bytes into the memory."""
        self.writes += 1
        data = data[: max(SIZE - address, 0)]
        self._memory[address : address + len(data)] = data
        if self.number("torque_enable"):
            self.put("present_position", self.number("goal_position"))


class GripperMotor(EmulatedMotor):
    """The motor of the gripper, which moves the fingers of a body, at the time (s) of `look`."""

    def __init__(self, config: So101Config, seed: int) -> None:
        super().__init__(config.motor, config.faults.model_number)
        settings = {**(GEARS if config.body == "sim" else {}), **config.body_config}
        self.fingers = EmulatedFingers(config.body, settings, config.object, seed)
        self.active_since_s = inf
        self._full_n = config.full_force_n
        self._stall_current_a = config.stall_current_a
        opened = opened_at(CLOSED, self.fingers.stroke_m, config.jaw_length_m)
        self._jaw = Jaw(CLOSED, opened, config.jaw_length_m)
        for name, value in (
            ("homing_offset", OFFSET),
            ("min_position_limit", CLOSED),
            ("max_position_limit", opened),
        ):
            self.put(name, value)
        self.look(0.0)
        self.put("goal_position", self.number("present_position"))

    def write(self, address: int, data: bytes) -> None:
        """Write bytes into the memory; the jaw moves in its own time."""
        self.writes += 1
        self._memory[address : address + len(data)] = data

    def look(self, now_s: float) -> None:
        """Move up to this time, and set the registers of what is measured."""
        jaw, fingers = self._jaw, self.fingers
        goal = self.number("goal_position")
        speed = abs(self.number("goal_velocity")) or FASTEST
        there = abs(goal - self.number("present_position")) <= DEAD_STEPS
        target = FingerTarget(
            fingers.gap_m if there else jaw.gap_m(goal),
            abs(jaw.gap_rate(jaw.position(fingers.gap_m), speed)),
            self._full_n * min(self.number("torque_limit"), FULL_LOAD) / FULL_LOAD,
        )
        fingers.move(now_s, target if self.number("torque_enable") else None)
        position = jaw.position(fingers.gap_m)
        velocity = fingers.velocity_m_s / jaw.gap_rate(position, 1.0)
        share = min(max(fingers.effort_n / self._full_n, -1.0), 1.0)
        self.put("present_position", position)
        self.put("present_velocity", round(velocity))
        self.put("present_load", round(share * FULL_LOAD))
        self.put("present_current", round(abs(share) * self._stall_current_a / AMPERES_A_STEP))
        self.put("moving", int(abs(velocity) > MOVING_STEPS_S))
