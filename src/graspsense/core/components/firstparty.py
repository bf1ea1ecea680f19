"""The distributions of this project and what each has, as plain strings; the only place in core that names them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from attrs import frozen

DISTRIBUTION: Final = "graspsense"
BUILTIN_MODULE: Final = "graspsense.plugins.builtin"
"""The plugin module of the components of this distribution."""


@frozen
class Shipped:
    """A distribution of this project beside `graspsense`: how it is installed, and the names that it has by kind.

    A kind is a role, or a word of `graspsense.core.components.entries.KIND_OF_ENTRY`.
    """

    distribution: str
    source: str
    """The extra of `graspsense` that brings it; of an example, its folder in a clone."""
    names: Mapping[str, tuple[str, ...]]

    @property
    def hint(self) -> str:
        """How it is installed."""
        if "/" in self.source:
            return f"in a clone: pip install -e ./{self.source}"
        return f'in a clone: pip install -r requirements-all.txt     published: pip install "graspsense[{self.source}]"'


SHIPPED: Final = (
    Shipped("graspsense-pr2-gripper", "pr2", {"sensor-backend": ("pr2",), "emulator": ("pr2",)}),
    Shipped("graspsense-sim-gripper", "sim", {"sensor-backend": ("sim",), "model": ("best", "default")}),
    Shipped("graspsense-c45", "c45", {"classifier": ("c45",)}),
    Shipped("graspsense-mujoco-gripper", "mujoco", {"sensor-backend": ("mujoco",)}),
    Shipped(
        "graspsense-franka-hand",
        "franka",
        {
            "sensor-backend": ("franka",),
            "feature-set": ("width-and-time",),
            "pipeline": ("franka",),
            "emulator": ("franka",),
        },
    ),
    Shipped(
        "graspsense-robotiq-2f",
        "robotiq",
        {"sensor-backend": ("robotiq",), "pipeline": ("robotiq",), "emulator": ("robotiq", "tsf85")},
    ),
    Shipped(
        "graspsense-ros2",
        "ros2",
        {"sensor-backend": ("ros2",), "command": ("ros2",), "live observer": ("ros2",)},
    ),
    Shipped(
        "graspsense-so101-gripper",
        "so101",
        {"sensor-backend": ("so101",), "pipeline": ("so101",), "emulator": ("so101",)},
    ),
    Shipped("graspsense-lerobot", "lerobot", {"sensor-backend": ("lerobot",), "data set": ("lerobot",)}),
    Shipped(
        "graspsense-romano",
        "romano",
        {
            "controller": (
                *("event-detector", "find-contact", "force-servo", "grab", "pick-and-place", "release"),
                "slip-servo",
            ),
            "feature-set": ("shake",),
            "pipeline": ("hold", "place", "shake"),
            "experiment": (
                *("contents_shake", "romano_grab", "romano_place", "romano_range", "romano_side"),
                "romano_slip",
            ),
            "kind of experiment": ("touch",),
        },
    ),
    Shipped(
        "graspsense-paper",
        "paper",
        {
            "experiment": (
                *("approach_speed", "controllers", "eleven_classes", "fig_4", "fig_5", "fig_6"),
                *("one_finger_first", "other_classifiers", "paper", "stiction", "table_2", "table_3"),
                *("table_4", "table_5", "table_6", "why_force", "worn_bottles"),
            ),
            "kind of experiment": ("grasp", "paper", "table"),
        },
    ),
    Shipped("graspsense-identify", "identify", {"identifier of objects for gripper": ("sim",)}),
)
"""The distributions in `plugins`, for the hint if one is not installed."""

EXAMPLES: Final = (
    Shipped("graspsense-grasp-curve", "examples/grasp_curve", {"feature-set": ("grasp-curve",)}),
)
"""The distributions in `examples`, which are installed from a clone only."""


def provider(kind: str, name: str) -> Shipped | None:
    """Return the distribution of this project that has a part of this kind and name; None if there is none."""
    return next((shipped for shipped in (*SHIPPED, *EXAMPLES) if name in shipped.names.get(kind, ())), None)
