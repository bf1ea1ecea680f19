"""A robot of LeRobot, of which one motor alone is read and commanded. LeRobot is imported when it is opened."""

from __future__ import annotations

import importlib
import json
import pkgutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from math import isfinite
from typing import Any, final

from graspsense.plugin_api import ConfigError, PluginUnavailable
from graspsense_lerobot.robot_config import LeRobotConfig


class NoAnswer(Exception):
    """The robot gives no answer, or none with the gripper in it; the text says why."""


@contextmanager
def _named_errors() -> Iterator[None]:
    """Raise NoAnswer for whatever the driver of a robot raises in this context."""
    try:
        yield
    except NoAnswer:
        raise
    except Exception as error:
        raise NoAnswer(f"{type(error).__name__}: {error}") from error


@final
class OneMotor:
    """The motor of a gripper. Construction connects the robot. Raises NoAnswer, ConfigError, PluginUnavailable."""

    def __init__(self, config: LeRobotConfig) -> None:
        self._config = config
        self._robot: Any = _made(config)
        self._require(self._robot.observation_features, "observation")
        self._require(self._robot.action_features, "action")
        self._bus: Any = getattr(self._robot, "bus", None)
        if config.load != "none" and self._bus is None:
            raise ConfigError(
                f"gripper.load is {config.load}, but {config.robot} has no motor bus of its own: set it to none"
            )
        try:
            # Calibration asks the user to move the robot, so that it would not end.
            with _named_errors():
                self._robot.connect(calibrate=False)
                if not self._robot.is_calibrated:
                    raise NoAnswer("it is not calibrated: run lerobot-calibrate for it")
                self._accepts_the_motor_alone()
        except BaseException:
            self.disconnect()
            raise

    def read(self) -> tuple[float, float]:
        """Return the position and the load, each in its unit; the load is 0 where it is not read. Raises NoAnswer."""
        with _named_errors():
            return self._read()

    def send(self, position: float) -> None:
        """Command this position of the gripper, and of nothing else. Raises NoAnswer."""
        with _named_errors():
            self._robot.send_action({self._config.key: position})

    def disconnect(self) -> None:
        """Let go of the robot, whatever it raises."""
        with suppress(Exception):
            self._robot.disconnect()

    def _accepts_the_motor_alone(self) -> None:
        """Command the gripper to where it is. Raises NoAnswer for a robot that wants, or moves, other motors too."""
        key = self._config.key
        position, _ = self._read()
        try:
            sent = self._robot.send_action({key: position})
        except (KeyError, ValueError, TypeError) as error:
            raise NoAnswer(
                f"it takes no action of {key} alone ({type(error).__name__}: {error}), and no other motor is commanded "
                "from here"
            ) from error
        moved = sorted(set(sent or ()) - {key}) if isinstance(sent, Mapping) else []
        if moved:
            raise NoAnswer(f"an action of {key} alone also commands {', '.join(moved[:4])}")

    def _read(self) -> tuple[float, float]:
        key, motor, register = self._config.key, self._config.motor, self._config.load
        seen = self._robot.get_observation()
        if key not in seen:
            raise NoAnswer(f"an observation has no {key}")
        position = float(seen[key])
        load = 0.0 if register == "none" else float(self._bus.sync_read(register, motor)[motor])
        if not isfinite(position) or not isfinite(load):
            raise NoAnswer(f"{key} is {position}, {register} is {load}")
        return position, load

    def _require(self, features: Mapping[str, Any], what: str) -> None:
        key = self._config.key
        if key not in features:
            known = ", ".join(sorted(features)[:12])
            raise ConfigError(
                f"no {what} of {self._config.robot} has {key!r}; there are {known}. Set gripper.motor or "
                "gripper.position"
            )


def stop(settings: str) -> None:
    """Let the gripper of these settings (JSON) stay where it is, and disconnect it. Raises NoAnswer, ConfigError.

    It is for a robot whose program was killed: the motors of LeRobot press on towards their last target.
    """
    # What is connected is commanded to where it is.
    OneMotor(LeRobotConfig(**json.loads(settings))).disconnect()


def _made(config: LeRobotConfig) -> Any:
    """Return the robot, not connected. Raises ConfigError, PluginUnavailable without LeRobot."""
    try:
        robots = importlib.import_module("lerobot.robots")
        importlib.import_module("lerobot.utils.import_utils").register_third_party_plugins()
        import draccus
    except ImportError as error:
        raise PluginUnavailable(
            f"the gripper lerobot needs LeRobot: {error}\n  try: pip install lerobot (it brings PyTorch)"
        ) from error
    failures = _known_types(robots)
    known = robots.RobotConfig.get_known_choices()
    if config.robot not in known:
        lacking = f"; not importable: {'; '.join(failures)}" if failures else ""
        raise ConfigError(
            f"LeRobot knows no robot {config.robot!r} (gripper.robot); it knows {', '.join(sorted(known))}{lacking}"
        )
    try:
        settings = draccus.decode(robots.RobotConfig, {"type": config.robot, **config.robot_config})
        return robots.make_robot_from_config(settings)
    except Exception as error:  # whatever the classes of a robot raise
        if isinstance(error, ImportError) or isinstance(error.__cause__, ImportError):
            raise PluginUnavailable(
                f"LeRobot's robot {config.robot} needs a driver: {error}\n  try: the extra of LeRobot for its motors, "
                'as in pip install "lerobot[feetech]"'
            ) from error
        raise ConfigError(
            f"gripper.robot_config of {config.robot}: {type(error).__name__}: {error}"
        ) from error


def _known_types(robots: Any) -> list[str]:
    """Import the robots of LeRobot, which makes their types known; return why some cannot be imported."""
    failures = []
    for module in pkgutil.iter_modules(robots.__path__, "lerobot.robots."):
        if module.ispkg:
            try:
                importlib.import_module(module.name)
            except Exception as error:  # most need a driver of their own
                failures.append(f"{module.name.rpartition('.')[2]} ({error})")
    return failures
