"""The gripper of an arm as a sensor backend. It writes to the gripper's motor only."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from math import inf
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final, TypeVar, final

from graspsense.gripper_api import (
    BackendWithEmulator,
    DeadManSwitch,
    Polling,
    calibrations_of,
    finger_target,
    lasting_port,
)
from graspsense.plugin_api import (
    NO_PADS,
    POSITION,
    VELOCITY,
    Channel,
    Command,
    DeviceInfo,
    DeviceLost,
    NoDevice,
    Reading,
    signal_type,
)
from graspsense_so101_gripper.arm_calibration import read_arm_calibration
from graspsense_so101_gripper.bus import NoStatusPacket, ServoBus
from graspsense_so101_gripper.config import So101Config
from graspsense_so101_gripper.discovery import serial_number
from graspsense_so101_gripper.emulator.lock_step import LockStepBus
from graspsense_so101_gripper.force import ForceOfMotor
from graspsense_so101_gripper.jaw import RADIANS_A_STEP, Unfit, jaw_of
from graspsense_so101_gripper.registers import (
    AMPERES_A_STEP,
    FULL_LOAD,
    IDENTITY,
    KELVIN,
    REGISTERS,
    STATE,
    STATUS_BITS,
    VOLTS_A_STEP,
    MotorRequest,
    MotorState,
    motor_state,
)

RATE_HZ: Final = 100.0
SPEED_LIMIT_M_S: Final = 0.3
FORCE_SPEED_M_S: Final = 0.02
"""Speed of a closing that only a force was asked for."""
STOP: Final = "graspsense_so101_gripper.bus:stop"
"""What is called if the program is killed."""
COMMAND_DELAY_S: Final = 0.02
"""A command is written at once (1 ms), and seen in the next frame (10 ms); the rest is for the motor to start."""

CHANNELS: Final = (
    Channel("gap", "m", RATE_HZ),
    Channel("velocity", "m/s", RATE_HZ),
    Channel("effort", "N", RATE_HZ),
    Channel("effort_error", "N", RATE_HZ),
    Channel("load", "1", RATE_HZ),
    Channel("current", "A", RATE_HZ),
    Channel("motor_speed", "rad/s", RATE_HZ),
    Channel("motor_voltage", "V", RATE_HZ),
    Channel("motor_temperature", "K", RATE_HZ),
)
SIGNALS: Final[Any] = signal_type(CHANNELS)
ReplyT = TypeVar("ReplyT")


@final
class So101Backend(BackendWithEmulator[So101Config]):
    """Turns commands into a goal with a speed and a torque limit; each read is one packet."""

    channels = CHANNELS
    accepts = ("velocity", "position", "force")
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "velocity": "the open or closed position, with this speed",
            "position": "the target, with the limits of the command as speed and torque limit",
            "force": "the closed position, with a torque limit for this force and at most 20 mm/s",
        }
    )
    command_delay_s = COMMAND_DELAY_S

    def __init__(self, config: So101Config) -> None:
        super().__init__(config)
        self.least_force_n = config.moving_force_n
        self.least_step_m = config.jaw_length_m * RADIANS_A_STEP
        self.least_speed_m_s = self.least_step_m
        self._bus: ServoBus | None = None
        self._polling = Polling(RATE_HZ)
        self._switch: DeadManSwitch | None = None
        self._found: MotorRequest | None = None
        self._asked: MotorRequest | None = None

    def open(self, seed: int) -> DeviceInfo:
        """Open the bus, compare the motor with what is known of it, and hold it where it is. Raises NoDevice."""
        self.close()
        config = self.config
        arm = read_arm_calibration(Path(config.arm_calibration)) if config.arm_calibration else None
        serial = serial_number(config, config.port)
        numbers = {"jaw_length_m": config.jaw_length_m, "force_from": config.force_from}
        stored = calibrations_of(config.calibration, serial, numbers)
        self._force = ForceOfMotor(config, stored)
        try:
            self._emulated = LockStepBus(config, seed) if config.emulated else None
            self._polling = Polling(RATE_HZ, self._emulated or time)
            self._bus = ServoBus(config.port, config.reply_timeout_s, self._emulated)
            memory = self._tried(lambda bus: bus.read(config.motor, *IDENTITY))
            self._jaw = jaw_of(memory, config, arm)
            state = self._state()
            self._found, self._position, self._stopped = state.asked, state.position, True
            if self._emulated is None:
                port = lasting_port(config.port)
                self._switch = DeadManSwitch(STOP, port, config.motor, config.reply_timeout_s, *state.asked)
            self._ask(self._asked_of(state.position, SPEED_LIMIT_M_S, config.moving_force_n))
        except (OSError, NoStatusPacket, Unfit) as error:
            self.close()
            raise NoDevice(
                f"no gripper of an SO-101 arm at {config.port}, motor {config.motor}: {error}. Look at the arm's power "
                "and cable, at gripper.port and gripper.motor; on Linux be in the group dialout"
            ) from error
        self._polling.begin()
        firmware = [REGISTERS[f"firmware_{part}_version"].number(memory) for part in ("major", "minor")]
        return self._described(serial, ".".join(map(str, firmware)), numbers, stored)

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next multiple of 10 ms, then read the motor. Raises DeviceLost."""
        if not self._polling.wait(timeout_s):
            return None
        state = self._still_ours(self._kept(self._state))
        self._position = state.position
        load = state.load * self._jaw.opens / FULL_LOAD
        effort_n, error_n = self._force.estimate(self._force.push(state, self._jaw.opens))
        frame = self._polling.frame(self._jaw.gap_m(state.position), effort_n, state.status)
        signals = SIGNALS(
            error_n,
            load,
            state.current * AMPERES_A_STEP,
            state.velocity * RADIANS_A_STEP,
            state.voltage * VOLTS_A_STEP,
            state.temperature + KELVIN,
        )
        return Reading(frame, NO_PADS, signals)

    def apply(self, command: Command) -> None:
        """Write the goal of this command, unless it is the present one. Raises DeviceLost."""
        jaw = self._jaw
        gap_m, speed, force = finger_target(command, jaw.gap_m(self._position), jaw.stroke_m, FORCE_SPEED_M_S)
        goal = jaw.position(gap_m)
        assert self._asked is not None
        if speed <= 0.0:
            # It stops once, where it is: a goal that followed the jaw would let it creep.
            goal, speed = (self._asked.goal_position if self._stopped else self._position), 0.0
        self._stopped = speed <= 0.0
        self._ask(self._asked_of(goal, speed or SPEED_LIMIT_M_S, force))

    def close(self) -> None:
        """Stop the jaw if the motor still responds, give it back as it was found, and close the bus."""
        bus, self._bus = self._bus, None
        given_back = True
        if bus is not None:
            if self._found is not None:
                given_back = self._give_back(bus, self._found)
            bus.close()
        switch, self._switch = self._switch, None
        if switch is not None:
            switch.release(stopped=given_back)
        self._found = self._asked = None

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return the number of frames, and of repeated exchanges, with what the emulated body knows."""
        return {**super().report(), **self._polling.report()}

    def emulation(self) -> Mapping[str, Any]:
        """Return the settings of a dry run, without the calibrations of the real arm."""
        return {**super().emulation(), "arm_calibration": "", "calibration": "none"}

    def _asked_of(self, goal: int, speed_m_s: float, force_n: float) -> MotorRequest:
        # A speed of 0 is the highest one to this motor.
        speed = max(int(self._jaw.speed(self._jaw.gap_m(self._position), min(speed_m_s, SPEED_LIMIT_M_S))), 1)
        return MotorRequest(
            torque_enable=1,
            acceleration=self.config.acceleration,
            goal_position=goal,
            goal_time=0,
            goal_velocity=speed,
            torque_limit=self._force.torque_limit(force_n),
        )

    def _ask(self, asked: MotorRequest) -> None:
        if asked != self._asked:
            data = asked.written()
            self._kept(lambda: self._tried(lambda bus: bus.write(self.config.motor, STATE[0], data)))
            self._asked = asked

    def _give_back(self, bus: ServoBus, request: MotorRequest) -> bool:
        """Let the motor stay where it is, with the torque and the limits that it had before, also if it only hears.

        Return whether the port was not lost.
        """
        motor, position = self.config.motor, self._position
        with suppress(NoStatusPacket, OSError):
            position = motor_state(bus.read(motor, *STATE)).position
        stop = request.staying_at(position).written()
        return self._polling.told(lambda: bus.write(motor, STATE[0], stop), NoStatusPacket)

    def _state(self) -> MotorState:
        return motor_state(self._tried(lambda bus: bus.read(self.config.motor, *STATE)))

    def _still_ours(self, state: MotorState) -> MotorState:
        """Return the state if the motor is asked what was written. Raises DeviceLost."""
        if state.asked == self._asked:
            return state
        why = (
            "its torque was switched off, by a loss of power or another program"
            if not state.asked.torque_enable
            else "another program commands it: end that"
        )
        raise DeviceLost(
            f"motor {self.config.motor} at {self.config.port} is not asked what was written: {why}"
        )

    def _tried(self, exchange: Callable[[ServoBus], ReplyT]) -> ReplyT:
        """Return the result of an exchange, which is repeated without a reply. Raises NoStatusPacket, OSError."""
        bus = self._bus
        assert bus is not None
        return self._polling.tried(lambda: exchange(bus), NoStatusPacket)

    def _kept(self, exchange: Callable[[], ReplyT]) -> ReplyT:
        """Return the result of an exchange with an open gripper. Raises DeviceLost."""
        if self._bus is None:
            raise DeviceLost("the gripper of the arm is not open")
        try:
            return exchange()
        except (NoStatusPacket, OSError) as error:
            raise DeviceLost(
                f"motor {self.config.motor} at {self.config.port} does not answer ({error}): look at its "
                "cable and power"
            ) from error

    def _described(
        self, serial: str, firmware: str, numbers: Mapping[str, float | str], stored: Mapping[str, Any]
    ) -> DeviceInfo:
        config = self.config
        measured = (
            f"effort is estimated from the motor's {config.force_from} by a load cell; effort_error is how far off it "
            "is in nine of ten readings"
            if self._force.calibrated
            else f"effort is the motor's {config.force_from} times its stall torque over gripper.jaw_length_m: an "
            "assumption, off by up to the full force until `graspsense calibrate load-cell`"
        )
        info = DeviceInfo(
            name="SO-101 gripper",
            serial=serial,
            firmware=firmware,
            clock="device",
            rate_hz=RATE_HZ,
            effort_limit_n=config.full_force_n * config.largest_load,
            speed_limit_m_s=SPEED_LIMIT_M_S,
            opening=Command(POSITION, self._jaw.stroke_m, inf, 0.05),
            # It still has a target to go to, where the encoder is wrong or the object yields.
            relaxed=Command(VELOCITY, 0.0, self.least_force_n, inf),
            calibration={kind: calibration.sha256 for kind, calibration in stored.items()},
            numbers=numbers,
            status_bits=STATUS_BITS,
            notes=(measured,),
        )
        return self.marked(info)
