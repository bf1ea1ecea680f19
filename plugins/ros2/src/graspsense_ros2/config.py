"""Settings of a gripper behind ROS 2: the topics that measure, and the action that moves."""

from __future__ import annotations

from typing import Literal

from attrs import frozen

from graspsense.gripper_api import MessageNumber
from graspsense.plugin_api import setting
from graspsense_ros2.names import is_name


@frozen(kw_only=True)
class Ros2Config:
    """A gripper behind ROS 2. Expressions name topics and fields as the manifest of a bag does, in quotes."""

    gap: str = setting(
        default="'/joint_states.position'[0]",
        meaning="The gap, computed of topics: '/joint_states.position'[0]*2, or with a unit as in '/hand.width' [mm].",
    )
    left: str = setting(
        default="",
        meaning="The force on the left pad (N): abs('/wrench_left.wrench.force.z'). Empty: not measured.",
    )
    right: str = setting(default="", meaning="The force on the right pad, likewise.")
    effort: str = setting(
        default="'/joint_states.effort'[0]", meaning="The effort of the drive (N). Empty: not measured."
    )
    velocity: str = setting(
        default="",
        meaning="The rate of the gap (m/s). Empty: from the gap.",
    )
    action: str = setting(
        default="/gripper_controller/gripper_cmd", meaning="Name of the action that moves the fingers."
    )
    action_type: Literal["GripperCommand", "ParallelGripperCommand"] = setting(
        default="GripperCommand", meaning="Type of the action, of the package control_msgs."
    )
    joint: str = setting(
        default="gripper_joint", meaning="ParallelGripperCommand only: name of the joint in the command."
    )
    open_gap_m: float = setting(
        default=0.085, unit="m", above=0.0, plausible=(0.005, 1.0), meaning="The gap of the open gripper."
    )
    position_open: float = setting(
        default=0.085, meaning="The position of the action that opens the gripper to open_gap_m."
    )
    position_closed: float = setting(default=0.0, meaning="The position of the action that closes it.")
    least_effort_n: float = setting(
        default=5.0,
        unit="N",
        above=0.0,
        plausible=(0.01, 200.0),
        meaning="The least effort that is asked for; many drivers take 0 as no limit.",
    )
    effort_limit_n: float = setting(
        default=40.0,
        unit="N",
        above=0.0,
        plausible=(0.1, 500.0),
        meaning="The greatest effort that is asked for.",
    )
    speed_limit_m_s: float = setting(
        default=0.05, unit="m/s", above=0.0, plausible=(1e-4, 0.5), meaning="The greatest speed of the gap."
    )
    rate_hz: float = setting(
        default=100.0,
        unit="Hz",
        above=0.0,
        plausible=(5.0, 1000.0),
        meaning="Frames a second, of the newest messages.",
    )
    delay_s: float = setting(
        default=0.1,
        unit="s",
        minimum=0.0,
        plausible=(0.0, 2.0),
        meaning="Longest time from a goal to the motion that follows; a controller waits as long (its step_time_s).",
    )
    silent_s: float = setting(
        default=0.5,
        unit="s",
        above=0.0,
        plausible=(0.01, 10.0),
        meaning="Age of the newest message of a topic from which on the gripper is lost.",
    )
    open_timeout_s: float = setting(
        default=5.0,
        unit="s",
        above=0.0,
        plausible=(0.1, 120.0),
        meaning="Longest wait for the topics and the action.",
    )
    through: Literal["auto", "rclpy", "zenoh"] = setting(
        default="auto", meaning="auto: rclpy where it can be imported, otherwise zenoh."
    )

    def __attrs_post_init__(self) -> None:
        self.numbers()
        if not is_name(self.action):
            raise ValueError(
                f"action {self.action!r} is no name of ROS: write it as in /gripper_controller/gripper_cmd"
            )
        if self.position_open == self.position_closed:
            raise ValueError("position_open and position_closed are equal: give the positions of both ends")
        if self.least_effort_n > self.effort_limit_n:
            raise ValueError("least_effort_n is above effort_limit_n")
        if bool(self.left) != bool(self.right):
            raise ValueError("left and right go together: where one force is measured, give it to both")

    def numbers(self) -> dict[str, MessageNumber]:
        """Return what is measured, by the name of its channel. Raises ConfigError."""
        texts: dict[str, tuple[str, Literal["gap", "force", "effort", "velocity"]]] = {
            "gap": (self.gap, "gap"),
            "force_left": (self.left, "force"),
            "force_right": (self.right, "force"),
            "effort": (self.effort, "effort"),
            "velocity": (self.velocity, "velocity"),
        }
        # Without a gap there is no gripper: that text is refused where it is empty.
        return {
            name: MessageNumber(text, what) for name, (text, what) in texts.items() if text or name == "gap"
        }
