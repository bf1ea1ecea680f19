"""The distributions and models that this project ships, as plain strings; the only place in core that names them."""

from __future__ import annotations

from typing import Final

from attrs import frozen

from graspsense.core.components.entries import Role

DISTRIBUTION: Final = "graspsense"
BUILTIN_MODULE: Final = "graspsense.plugins.builtin"
"""The plugin module of the components of this distribution."""


@frozen
class Shipped:
    """A distribution of this project: its folder in a clone, and its extra of `graspsense`."""

    distribution: str
    folder: str
    extra: str

    @property
    def hint(self) -> str:
        """The commands that install it, from a clone and from an index."""
        return (
            f"in a clone: pip install -e . -e ./plugins/{self.folder}"
            f'     published: pip install "graspsense[{self.extra}]"'
        )


_PR2 = Shipped("graspsense-pr2-gripper", "pr2_gripper", "pr2")
_SIM = Shipped("graspsense-sim-gripper", "sim_gripper", "sim")
_MUJOCO = Shipped("graspsense-mujoco-gripper", "mujoco_gripper", "mujoco")
_FRANKA = Shipped("graspsense-franka-hand", "franka_hand", "franka")
_ROBOTIQ = Shipped("graspsense-robotiq-2f", "robotiq_2f", "robotiq")
_ROS2 = Shipped("graspsense-ros2", "ros2", "ros2")
_SO101 = Shipped("graspsense-so101-gripper", "so101_gripper", "so101")
_C45 = Shipped("graspsense-c45", "c45", "c45")
_PAPER = Shipped("graspsense-paper", "paper", "paper")
_ROMANO = Shipped("graspsense-romano", "romano", "romano")
_IDENTIFY = Shipped("graspsense-identify", "identify", "identify")

SHIPPED: Final[dict[tuple[Role, str], Shipped]] = {
    ("sensor-backend", "pr2"): _PR2,
    ("sensor-backend", "sim"): _SIM,
    ("sensor-backend", "mujoco"): _MUJOCO,
    ("sensor-backend", "franka"): _FRANKA,
    ("sensor-backend", "robotiq"): _ROBOTIQ,
    ("sensor-backend", "ros2"): _ROS2,
    ("sensor-backend", "so101"): _SO101,
    ("feature-set", "width-and-time"): _FRANKA,
    ("feature-set", "shake"): _ROMANO,
    ("classifier", "c45"): _C45,
    ("controller", "find-contact"): _ROMANO,
    ("controller", "force-servo"): _ROMANO,
    ("controller", "slip-servo"): _ROMANO,
    ("controller", "grab"): _ROMANO,
    ("controller", "release"): _ROMANO,
    ("controller", "pick-and-place"): _ROMANO,
    ("controller", "event-detector"): _ROMANO,
}
"""Components in other distributions of this project, for the hint if one is not installed."""


@frozen
class Example:
    """A distribution of this project that is an example, installed from a clone only: its folder in `examples`."""

    distribution: str
    folder: str

    @property
    def hint(self) -> str:
        """The command that installs it."""
        return f"in a clone: pip install -e ./examples/{self.folder}"


_OWN_ROBOTIQ = Example("graspsense-robotiq-2f85", "robotiq_2f85")
_CURVE = Example("graspsense-grasp-curve", "grasp_curve")

EXAMPLES: Final[dict[tuple[Role, str], Example]] = {
    ("sensor-backend", "robotiq-2f85"): _OWN_ROBOTIQ,
    ("feature-set", "grasp-curve"): _CURVE,
    ("feature-set", "chitta-and-curve"): _CURVE,
}
"""Components of the examples, for the hint if one is not installed."""

MODELS: Final[dict[str, Shipped]] = {"default": _SIM, "best": _SIM}
"""Models that this project ships, with their distributions."""

EXPERIMENTS: Final[dict[str, Shipped]] = dict.fromkeys(
    (
        *("approach_speed", "controllers", "eleven_classes", "fig_4", "fig_5", "fig_6", "one_finger_first"),
        *("other_classifiers", "paper", "stiction", "table_2", "table_3", "table_4", "table_5", "table_6"),
        *("why_force", "worn_bottles"),
    ),
    _PAPER,
) | dict.fromkeys(("contents_shake", "romano_grab", "romano_place", "romano_slip"), _ROMANO)
"""Experiments in other distributions of this project."""

EXPERIMENT_KINDS: Final[dict[str, Shipped]] = dict.fromkeys(("grasp", "paper", "table"), _PAPER) | {
    "touch": _ROMANO
}
"""Kinds of experiments in other distributions of this project."""

IDENTIFIERS: Final[dict[str, Shipped]] = {"sim": _IDENTIFY}
"""What identifies objects as scenes of a sensor backend, in other distributions of this project."""
