"""A robot of LeRobot as a sensor backend: one of its motors is the gripper.

The motor gets positions only, and pushes the harder the further its target is ahead of the fingers. So a limit of
force is one of that distance, and a speed is that of a target that moves.
"""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from contextlib import suppress
from math import inf, nan
from types import MappingProxyType
from typing import Final, final

from attrs import asdict

from graspsense.gripper_api import DeadManSwitch, Polling, finger_target
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
    SensorBackend,
)
from graspsense_lerobot.robot import NoAnswer, OneMotor
from graspsense_lerobot.robot_config import LeRobotConfig

SLOPE_FRAMES: Final = 4
OPENING_M_S: Final = 0.05
STOP: Final = "graspsense_lerobot.robot:stop"


@final
class LeRobotBackend(SensorBackend[LeRobotConfig]):
    """Turns commands into positions of one motor; each read is one observation of the robot."""

    accepts = ("velocity", "position", "force")
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "velocity": "a target that moves at this speed, ahead of the fingers by as much as the force allows",
            "position": "a target that moves there at the speed of the command, ahead by as much as the force allows",
            "force": "a target ahead of the fingers by the force over gripper.newtons_per_metre",
        }
    )

    def __init__(self, config: LeRobotConfig) -> None:
        super().__init__(config)
        self._motor: OneMotor | None = None
        self._switch: DeadManSwitch | None = None
        self._polling = Polling(config.rate_hz, time, SLOPE_FRAMES)
        self._gap_m = self._target_m = self._effort_n = 0.0
        self.command_delay_s = 1.0 / config.rate_hz

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The gap and its rate; with a load the effort."""
        rate = self.config.rate_hz
        bare = (Channel("gap", "m", rate), Channel("velocity", "m/s", rate))
        return bare if self.config.load == "none" else (*bare, Channel("effort", "N", rate))

    def open(self, seed: int) -> DeviceInfo:
        """Connect the robot; nothing moves. Raises NoDevice, ConfigError, PluginUnavailable."""
        self.close()
        config = self.config
        self._polling = Polling(config.rate_hz, time, SLOPE_FRAMES)
        try:
            self._motor = OneMotor(config)
            self._switch = DeadManSwitch(STOP, json.dumps(asdict(config), default=str))
            position, _ = self._polling.tried(self._motor.read, NoAnswer)
        except NoAnswer as error:
            self.close()
            raise NoDevice(
                f"no {config.robot} as gripper.robot_config describes it: {error}. Look at its power and cable, and at "
                "gripper.robot_config"
            ) from error
        self._gap_m = self._target_m = config.gap_m(position)
        self._polling.begin()
        return self._described()

    def read(self, timeout_s: float) -> Reading | None:
        """Wait until the next observation is due, and make it. Raises DeviceLost."""
        if not self._polling.wait(timeout_s):
            return None
        try:
            position, load = self._polling.tried(self._opened().read, NoAnswer)
        except NoAnswer as error:
            raise self._lost(error) from error
        self._gap_m = self.config.gap_m(position)
        self._effort_n = load * self.config.newtons_per_unit
        effort_n = nan if self.config.load == "none" else self._effort_n
        return Reading(self._polling.frame(self._gap_m, effort_n), NO_PADS)

    def apply(self, command: Command) -> None:
        """Move the target on by the way of one frame, and send it. Raises DeviceLost."""
        self._target_m = self._next_target(command)
        try:
            self._send(self._opened(), self.config.position_at(self._target_m))
        except NoAnswer as error:
            raise self._lost(error) from error

    def close(self) -> None:
        """Stop the fingers where they are, and disconnect the robot."""
        motor, self._motor = self._motor, None
        try:
            if motor is not None:
                position = self.config.position_at(self._gap_m)
                with suppress(NoAnswer):
                    position, _ = self._polling.tried(motor.read, NoAnswer)
                with suppress(NoAnswer):
                    self._send(motor, position)
        finally:
            if motor is not None:
                motor.disconnect()
            switch, self._switch = self._switch, None
            if switch is not None:
                switch.release()

    def report(self) -> dict[str, float | int | str | bool]:
        """Return the number of frames and of repeated questions, and how long the longest took."""
        return {**self._polling.report()}

    def _send(self, motor: OneMotor, position: float) -> None:
        self._polling.tried(lambda: motor.send(position), NoAnswer)

    def _next_target(self, command: Command) -> float:
        config = self.config
        goal_m, speed_m_s, force_n = finger_target(
            command, self._gap_m, config.open_gap_m, closed_m=config.closed_gap_m
        )
        if speed_m_s == 0.0:
            return self._gap_m
        step_m = min(speed_m_s, config.most_speed_m_s) / config.rate_hz
        force_n = min(max(force_n, 0.0), config.most_force_n)
        if goal_m < self._gap_m and self._effort_n > force_n:
            # The fingers push harder than they may, which is measured: back.
            return min(self._target_m + step_m, self._gap_m)
        target_m = self._target_m + min(max(goal_m - self._target_m, -step_m), step_m)
        ahead_m = force_n / config.newtons_per_metre
        return min(max(target_m, self._gap_m - ahead_m), self._gap_m + max(ahead_m, step_m))

    def _described(self) -> DeviceInfo:
        config = self.config
        measured = config.load != "none"
        return DeviceInfo(
            name=f"{config.robot}, motor {config.motor}",
            serial=str(config.robot_config.get("id", "")),
            clock="device",
            rate_hz=config.rate_hz,
            effort_limit_n=config.most_force_n,
            speed_limit_m_s=config.most_speed_m_s,
            opening=Command(POSITION, config.open_gap_m, inf, min(OPENING_M_S, config.most_speed_m_s)),
            relaxed=Command(VELOCITY, 0.0, inf, inf),
            numbers={
                "position_unit": config.unit,
                "open_position": config.open_position,
                "closed_position": config.closed_position,
                "open_gap_m": config.open_gap_m,
                "closed_gap_m": config.closed_gap_m,
                "newtons_per_metre": config.newtons_per_metre,
                **({"newtons_per_unit": config.newtons_per_unit} if measured else {}),
            },
            notes=(
                f"the gap is linear between {config.open_position:g} and {config.closed_position:g} {config.unit}",
                f"effort is {config.load} times gripper.newtons_per_unit, an assumption unless you measured it"
                if measured
                else "no force is measured: its limit is the distance of the target, by gripper.newtons_per_metre",
                "the other motors of the robot get no command",
            ),
        )

    def _opened(self) -> OneMotor:
        if self._motor is None:
            raise DeviceLost(f"{self.config.robot} is not open: open it before reading")
        return self._motor

    def _lost(self, error: NoAnswer) -> DeviceLost:
        return DeviceLost(f"{self.config.robot} does not answer ({error}): look at its cable and power")
