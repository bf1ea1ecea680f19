"""A gripper behind ROS 2 as a sensor backend: topics measure, an action moves."""

from __future__ import annotations

import os
import time
from collections.abc import Mapping
from contextlib import suppress
from math import inf, isfinite, nan
from types import MappingProxyType
from typing import ClassVar, Final, final

from attrs import astuple

from graspsense.gripper_api import Clock, DeadManSwitch, Polling, StatusBit, finger_target
from graspsense.plugin_api import (
    FORCE,
    NO_PADS,
    POSITION,
    Channel,
    Command,
    ConfigError,
    DeviceInfo,
    DeviceLost,
    NoDevice,
    Reading,
    SensorBackend,
)
from graspsense.simulator_api import CHANNELS
from graspsense_ros2.action_client import MOST_FAILURES, ActionType, GripperAction, Target
from graspsense_ros2.config import Ros2Config
from graspsense_ros2.message_types import is_known
from graspsense_ros2.middleware import Through, open_node
from graspsense_ros2.newest_messages import NewestMessage
from graspsense_ros2.node import Node, ServiceFailed

GOAL_PERIOD_S: Final = 0.05
"""Time between two goals while the target moves."""
AHEAD_M: Final = 0.004
"""How far the target can be ahead of the fingers while they close."""
LOOK_AGAIN_S: Final = 0.02
LATE_S: Final = 0.1
"""By how much later than the quickest one a message may come without a fault."""
REPEATED: Final = 3
"""Messages without a new stamp, or with an earlier one, that are a fault."""
MESSAGES_LATE, MESSAGES_REPEATED = 1, 2
STATUS_BITS: Final = (
    StatusBit(
        mask=MESSAGES_LATE,
        name="messages late",
        meaning=f"their stamps are {LATE_S:g} s older than at best, so gaps, forces and times do not fit; look at the "
        "network, the load of both computers and their clocks",
    ),
    StatusBit(
        mask=MESSAGES_REPEATED,
        name="messages repeated",
        meaning="some have the stamp of an earlier one, so a standstill may be none; look at the node that publishes "
        "them",
    ),
)
_MUST_BE_NUMBERS: Final = frozenset({"gap", "force_left", "force_right"})


@final
class Ros2Backend(SensorBackend[Ros2Config]):
    """A gripper that is measured by topics and closes by itself to the goals of an action."""

    accepts = ("position", "force")
    clock: ClassVar[Clock] = time
    closes_itself: Mapping[str, str] = MappingProxyType(
        {
            "position": "goals that approach the target at its speed, with its force as their effort",
            "force": "goals that approach the closed position at its speed, with this force as their effort",
        }
    )

    def __init__(self, config: Ros2Config) -> None:
        super().__init__(config)
        self.least_force_n = config.least_effort_n
        self.command_delay_s = config.delay_s
        self._numbers = config.numbers()
        self._node: Node | None = None
        self._action: GripperAction | None = None
        self._switch: DeadManSwitch | None = None
        self._topics: dict[str, NewestMessage] = {}
        self._polling = Polling(config.rate_hz, self.clock)
        self._report: dict[str, float | int | str | bool] = {}

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The gap, its rate, and what else the settings name."""
        names = dict.fromkeys(("gap", "velocity", *self._numbers))
        return tuple(Channel(name, CHANNELS[name], self.config.rate_hz) for name in names)

    def open(self, seed: int) -> DeviceInfo:
        """Subscribe to the topics and look for the action; no finger moves. Raises NoDevice."""
        self.close()
        self._report = {}
        until = self.clock.monotonic() + self.config.open_timeout_s
        try:
            self._node = open_node(f"graspsense_gripper_{os.getpid()}", self.config.through)
            topics = sorted({topic for number in self._numbers.values() for topic in number.topics})
            self._topics = {topic: self._subscribed(topic, until) for topic in topics}
            for newest in self._topics.values():
                while not newest.came and self.clock.monotonic() < until:
                    self.clock.sleep(LOOK_AGAIN_S)
                if not newest.came and not newest.columns:
                    raise NoDevice(f"no message on {newest.topic}, although it is announced{_damage(newest)}")
            self._action = self._answering(until)
            action = (self.config.through, self.config.action, self.config.action_type, self.config.joint)
            self._switch = DeadManSwitch(f"{__name__}:opened_by_itself", *action, *astuple(self._opening()))
            self._polling = Polling(self.config.rate_hz, self.clock)
            self._good = dict.fromkeys(self._numbers, (nan, self._polling.began_s))
            self._gap_m = self._measured()["gap"]
            self._repeated = sum(topic.repeated + topic.late for topic in self._topics.values())
        except (DeviceLost, ConfigError) as error:
            self.close()
            raise NoDevice(str(error)) from error
        except NoDevice:
            self.close()
            raise
        self._target_m = self._gap_m
        self._sent: Target | None = None
        self._sent_s = -inf
        return self._described()

    def read(self, timeout_s: float) -> Reading | None:
        """Wait for the next frame, and return the newest numbers. Raises DeviceLost."""
        if self._action is None:
            raise DeviceLost("the gripper behind ROS 2 is not open")
        if not self._polling.wait(timeout_s):
            return None
        if self._action.failures >= MOST_FAILURES:
            raise DeviceLost(f"{MOST_FAILURES} goals in a row failed: {self._action.said}")
        numbers = self._measured()
        self._gap_m = numbers["gap"]
        frame = self._polling.frame(self._gap_m, numbers.get("effort", nan), self._status())
        frame = frame._replace(
            velocity_m_s=numbers.get("velocity", frame.velocity_m_s),
            force_left_n=numbers.get("force_left", nan),
            force_right_n=numbers.get("force_right", nan),
        )
        return Reading(frame, NO_PADS)

    def apply(self, command: Command) -> None:
        """Send the goal that this command becomes, unless it was sent already."""
        assert self._action is not None
        config = self.config
        goal, speed, effort = finger_target(command, self._gap_m, config.open_gap_m)
        speed = min(speed, config.speed_limit_m_s)
        step = speed / config.rate_hz
        # Where the fingers turn, the target that is left from the other direction would still push or pull.
        ahead = (self._gap_m, inf) if goal > self._gap_m else (self._gap_m - AHEAD_M, self._gap_m)
        self._target_m = min(
            max(self._target_m + min(max(goal - self._target_m, -step), step), ahead[0]), ahead[1]
        )
        if effort <= 0.0:
            self._target_m = self._gap_m
        target = Target(
            position=self._position(self._target_m),
            effort=min(max(effort, config.least_effort_n), config.effort_limit_n),
            speed=speed,
        )
        now_s = self.clock.monotonic()
        if target != self._sent and now_s - self._sent_s >= GOAL_PERIOD_S:
            self._sent, self._sent_s = target, now_s
            self._action.want(target)

    def close(self) -> None:
        """Tell the fingers to open if they were moved, and leave the network."""
        node, self._node = self._node, None
        action, self._action = self._action, None
        if action is not None:
            action.end()
            # A goal that opens may not have been sent yet, or have opened the fingers a part of the way.
            if self._sent is not None:
                self._report["told_to_open"] = self._told_to_open(action)
            self._report |= {
                "frames": self._polling.frames,
                "goals": action.goals,
                "damaged_messages": sum(newest.damaged for newest in self._topics.values()),
                "late_messages": sum(newest.late for newest in self._topics.values()),
                "repeated_messages": sum(newest.repeated for newest in self._topics.values()),
            }
        if node is not None:
            node.close()
        switch, self._switch = self._switch, None
        if switch is not None:
            switch.release()

    def report(self) -> dict[str, float | int | str | bool]:
        """Return the number of frames, of goals, and of messages that could not be used."""
        return self._report

    def _status(self) -> int:
        """Return the bits of what is wrong with the messages since the gripper was opened."""
        newest = self._topics.values()
        late = any(topic.lateness_s > LATE_S for topic in newest)
        repeated = sum(topic.repeated + topic.late for topic in newest) - self._repeated
        return MESSAGES_LATE * late + MESSAGES_REPEATED * (repeated >= REPEATED)

    def _opening(self) -> Target:
        config = self.config
        return Target(config.position_open, config.effort_limit_n, config.speed_limit_m_s)

    def _told_to_open(self, action: GripperAction) -> bool:
        with suppress(ServiceFailed):
            action.send(self._opening())
            return True
        with suppress(ServiceFailed):
            action.cancel()
        return False

    def _position(self, gap_m: float) -> float:
        """Return the position of the action for a gap, within its ends."""
        config = self.config
        share = min(max(gap_m / config.open_gap_m, 0.0), 1.0)
        return config.position_closed + share * (config.position_open - config.position_closed)

    def _measured(self) -> dict[str, float]:
        """Return the newest number of each channel. Raises DeviceLost where one is missing for too long."""
        config, now_s = self.config, self.clock.monotonic()
        columns: dict[str, object] = {}
        for newest in self._topics.values():
            if newest.age_s() > config.silent_s and (newest.came or not newest.columns):
                raise DeviceLost(
                    f"no message on {newest.topic} for {config.silent_s:g} s{_damage(newest)}: look at the node that "
                    "publishes it (gripper.silent_s)"
                )
            if newest.ambiguous:
                raise DeviceLost(
                    f"{newest.topic} has messages of other joints too, so a place in their arrays can be that of "
                    f"another joint: name the joint, as in '{newest.topic}.position.JOINT'"
                )
            columns |= newest.columns
        numbers = {}
        for name, number in self._numbers.items():
            try:
                value = number.value(columns)  # type: ignore[arg-type]
            except ConfigError as error:
                raise DeviceLost(f"gripper settings, {name}: {error}") from error
            if isfinite(value) or name not in _MUST_BE_NUMBERS:
                self._good[name] = (value, now_s)
            elif now_s - self._good[name][1] > config.silent_s or self._good[name][0] != self._good[name][0]:
                raise DeviceLost(f"{number.text} is {value} for longer than {config.silent_s:g} s")
            numbers[name] = self._good[name][0]
        return numbers

    def _subscribed(self, topic: str, until: float) -> NewestMessage:
        """Subscribe to a topic with the type that it is published with. Raises NoDevice."""
        assert self._node is not None
        while not (types := self._node.types_of(topic)):
            if self.clock.monotonic() > until:
                raise NoDevice(
                    f"nobody publishes {topic} within {self.config.open_timeout_s:g} s. Look at ROS_DOMAIN_ID, at the "
                    "router (ros2 run rmw_zenoh_cpp rmw_zenohd), and at the names in the settings of the gripper"
                )
            self.clock.sleep(LOOK_AGAIN_S)
        if len(types) > 1 or not is_known(types[0]):
            raise NoDevice(
                f"{topic} has the type {', '.join(types)}: it has to be one, of the common interfaces of ROS, such as "
                "sensor_msgs/msg/JointState, geometry_msgs/msg/WrenchStamped or std_msgs/msg/Float64MultiArray"
            )
        names = frozenset[str]().union(*(number.names for number in self._numbers.values()))
        newest = NewestMessage(
            topic, types[0], frozenset(name for name in names if name.startswith(f"{topic}.")), self.clock
        )
        self._node.subscribe(topic, types[0], newest.take)
        return newest

    def _answering(self, until: float) -> GripperAction:
        """Return the action once it answers. Raises NoDevice."""
        assert self._node is not None
        config = self.config
        action = GripperAction(self._node, config.action, config.action_type, config.joint)
        while True:
            try:
                # Without a goal there is nothing to cancel: this asks only whether it is there.
                action.cancel()
                return action
            except ServiceFailed as error:
                if self.clock.monotonic() > until:
                    action.end()
                    raise NoDevice(f"the action {config.action} ({config.action_type}): {error}") from error
                self.clock.sleep(LOOK_AGAIN_S)

    def _described(self) -> DeviceInfo:
        config = self.config
        return DeviceInfo(
            name=f"gripper behind ROS 2 ({config.action})",
            clock="device",
            rate_hz=config.rate_hz,
            effort_limit_n=config.effort_limit_n,
            speed_limit_m_s=config.speed_limit_m_s,
            opening=Command(POSITION, config.open_gap_m, config.effort_limit_n, config.speed_limit_m_s),
            relaxed=Command(FORCE, 0.0, inf, inf),
            status_bits=STATUS_BITS,
            numbers={name: number.text for name, number in self._numbers.items()},
            notes=(
                "forces and gap are those of ROS topics; their calibration and their zero are a matter of the driver",
            ),
        )


def opened_by_itself(
    through: Through, name: str, kind: ActionType, joint: str, position: float, effort: float, speed: float
) -> None:
    """Tell the gripper of a killed program to open. Raises ServiceFailed, ConfigError."""
    node = open_node(f"graspsense_opening_{os.getpid()}", through)
    try:
        action = GripperAction(node, name, kind, joint)
        action.send(Target(position, effort, speed))
        action.end()
    finally:
        node.close()


def _damage(newest: NewestMessage) -> str:
    counts = {"damaged": newest.damaged, "late": newest.late}
    words = [f"{count} {what}" for what, count in counts.items() if count]
    return f" ({', '.join(words)})" if words else ""
