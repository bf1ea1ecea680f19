"""Settings of a LeRobot robot as a gripper: the robot, the motor of the gripper, and what its numbers mean."""

from __future__ import annotations

from typing import Any, Literal

from attrs import frozen

from graspsense.plugin_api import setting


@frozen(kw_only=True)
class LeRobotConfig:
    """A robot that LeRobot knows, and the motor of its gripper."""

    robot: str = setting(default="so101_follower", meaning="LeRobot's name of the type of robot.")
    robot_config: dict[str, Any] = setting(
        factory=dict, meaning='LeRobot\'s settings of this robot, as in {port = "/dev/ttyACM0", id = "left"}.'
    )
    motor: str = setting(default="gripper", meaning="Name of the motor that moves the gripper.")
    position: str = setting(
        default="", meaning="Name of its position in observations and actions; empty: MOTOR.pos."
    )
    unit: Literal["percent", "degrees", "radians", "metres"] = setting(
        default="percent", meaning="The unit of the position, as LeRobot gives it."
    )
    open_position: float = setting(default=100.0, meaning="Position, in its unit, when open.")
    closed_position: float = setting(default=0.0, meaning="Position, in its unit, when closed.")
    open_gap_m: float = setting(
        default=0.08,
        unit="m",
        above=0.0,
        plausible=(1e-3, 0.5),
        meaning="Gap when open, an assumption until you measure yours; linear between open and closed.",
    )
    closed_gap_m: float = setting(default=0.0, unit="m", minimum=0.0, meaning="Gap when closed.")
    load: Literal["none", "Present_Load", "Present_Current"] = setting(
        default="none", meaning="What the motor bus is asked for as the load of the motor."
    )
    newtons_per_unit: float = setting(
        default=0.02,
        meaning="Force on each finger per unit of the load; negative where the load falls on closing. An assumption: "
        "measure yours.",
    )
    newtons_per_metre: float = setting(
        default=1000.0,
        unit="N/m",
        above=0.0,
        plausible=(10.0, 1e6),
        meaning="Force of a blocked finger per metre by which the target is ahead of it, since LeRobot commands "
        "positions only. It makes a limit of force one of the target. An assumption: measure yours.",
    )
    most_force_n: float = setting(
        default=30.0, unit="N", above=0.0, plausible=(0.5, 500.0), meaning="Largest force of a finger."
    )
    most_speed_m_s: float = setting(
        default=0.1, unit="m/s", above=0.0, plausible=(1e-3, 1.0), meaning="Largest speed of the gap."
    )
    rate_hz: float = setting(
        default=30.0,
        unit="Hz",
        above=0.0,
        plausible=(1.0, 1000.0),
        meaning="Observations per second. The robot is observed as a whole: its cameras, if any, slow it down.",
    )

    @property
    def key(self) -> str:
        """The name of the position in observations and actions."""
        return self.position or f"{self.motor}.pos"

    def gap_m(self, position: float) -> float:
        """Return the gap at this position; it is linear between that of the closed and that of the open gripper."""
        share = (position - self.closed_position) / (self.open_position - self.closed_position)
        return self.closed_gap_m + share * (self.open_gap_m - self.closed_gap_m)

    def position_at(self, gap_m: float) -> float:
        """Return the position of this gap; a gap beyond the ends is that of the nearer end."""
        share = (gap_m - self.closed_gap_m) / (self.open_gap_m - self.closed_gap_m)
        return self.closed_position + min(max(share, 0.0), 1.0) * (self.open_position - self.closed_position)

    def __attrs_post_init__(self) -> None:
        if self.open_position == self.closed_position:
            raise ValueError(
                f"open_position and closed_position are both {self.open_position:g}: they differ"
            )
        if not self.closed_gap_m < self.open_gap_m:
            raise ValueError(
                f"closed_gap_m {self.closed_gap_m:g} is not below open_gap_m {self.open_gap_m:g}"
            )
