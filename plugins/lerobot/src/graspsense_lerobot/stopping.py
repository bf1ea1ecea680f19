"""Stopping the gripper of a robot whose program was killed: LeRobot's motors press on towards their last target."""

from __future__ import annotations

import json

from graspsense_lerobot.robot import OneMotor
from graspsense_lerobot.robot_config import LeRobotConfig


def stop(settings: str) -> None:
    """Let the gripper of these settings (JSON) stay where it is, and disconnect it. Raises NoAnswer, ConfigError."""
    # What is connected is commanded to where it is.
    OneMotor(LeRobotConfig(**json.loads(settings))).disconnect()
