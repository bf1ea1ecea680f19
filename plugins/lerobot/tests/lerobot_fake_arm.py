"""A robot of LeRobot without hardware: six motors, of which the gripper closes on a spring between its fingers."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import lerobot_stand_in  # noqa: F401
from lerobot.robots import Robot, RobotConfig

MOTORS = ("shoulder_pan", "shoulder_lift", "elbow_flex", "wrist_flex", "wrist_roll", "gripper")
OPEN_M = 0.08
SERVO_N_M = 1000.0
"""Force of the servo per metre of error, the default of the backend."""
OBJECT_N_M = 20000.0
SPEED_M_S = 0.15
UNITS_N = 0.02
"""Newtons per unit of the load, the default of the backend."""


class Clock:
    """The time of robot and backend: it passes when one of them sleeps or looks."""

    now_s = 0.0

    @classmethod
    def sleep(cls, seconds):
        cls.now_s += seconds

    @classmethod
    def monotonic(cls):
        cls.sleep(0.0005)
        return cls.now_s


class Bus:
    def __init__(self, robot):
        self.robot = robot

    def sync_read(self, register, motors=None):
        assert register in ("Present_Load", "Present_Current")
        return {motors: self.robot.force_n / UNITS_N}


@RobotConfig.register_subclass("fake_arm")
@dataclass(kw_only=True)
class FakeArmConfig(RobotConfig):
    port: str = "there"
    unplugged_s: float = 1e9
    wants_all: bool = False
    moves_others: bool = False
    calibrated: bool = True
    damaged_every: int = 0
    object_m: float = 0.05
    driver: bool = True


class FakeArm(Robot):
    config_class = FakeArmConfig
    name = "fake_arm"
    made: ClassVar[list] = []

    def __init__(self, config):
        super().__init__(config)
        if not config.driver:
            raise ModuleNotFoundError("No module named 'scservo_sdk'")
        self.config, self.bus = config, Bus(self)
        self.gap_m = self.target_m = 0.07
        self.force_n, self.asked, self.connected, self.actions = 0.0, 0, False, []
        FakeArm.made.append(self)

    @property
    def observation_features(self):
        return {f"{motor}.pos": float for motor in MOTORS}

    @property
    def action_features(self):
        return self.observation_features

    @property
    def is_connected(self):
        return self.connected

    @property
    def is_calibrated(self):
        return self.config.calibrated

    def calibrate(self):
        raise AssertionError("it would ask the user")

    def configure(self):
        pass

    def connect(self, calibrate=True):
        assert not calibrate
        if self.config.port != "there":
            raise ConnectionError(f"no port {self.config.port}")
        self.connected, self.began_s, self.last_s = True, Clock.now_s, Clock.now_s

    def disconnect(self):
        self.connected = False

    def get_observation(self):
        self._move()
        values = dict.fromkeys(self.observation_features, 12.0)
        return {**values, "gripper.pos": 100.0 * self.gap_m / OPEN_M}

    def send_action(self, action):
        self._move()
        if self.config.wants_all and len(action) < len(MOTORS):
            raise KeyError("shoulder_pan.pos")
        self.actions.append(dict(action))
        self.target_m = action["gripper.pos"] * OPEN_M / 100.0
        return {**action, "elbow_flex.pos": 0.0} if self.config.moves_others else action

    def _move(self):
        if not self.connected or Clock.now_s - self.began_s > self.config.unplugged_s:
            raise ConnectionError("no status packet")
        self.asked += 1
        if self.config.damaged_every and self.asked % self.config.damaged_every == 0:
            raise ConnectionError("incorrect status packet")
        most_m = SPEED_M_S * max(Clock.now_s - self.last_s, 0.0)
        self.last_s = Clock.now_s
        rest_m = self.target_m
        if self.target_m < self.config.object_m:
            # Where the spring of the servo and that of the object balance.
            pulled_n = SERVO_N_M * self.target_m + OBJECT_N_M * self.config.object_m
            rest_m = pulled_n / (SERVO_N_M + OBJECT_N_M)
        self.gap_m += min(max(rest_m - self.gap_m, -most_m), most_m)
        self.force_n = OBJECT_N_M * max(self.config.object_m - self.gap_m, 0.0)
