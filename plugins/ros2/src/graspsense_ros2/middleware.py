"""What carries the messages of a node: rclpy, or zenoh without a ROS installation."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Literal

from graspsense.plugin_api import ConfigError
from graspsense_ros2.node import Node

Through = Literal["auto", "rclpy", "zenoh"]


def open_node(name: str, through: Through = "auto") -> Node:
    """Return a new node: by rclpy where it can be imported, otherwise by zenoh. Raises ConfigError."""
    if through == "rclpy" or (through == "auto" and find_spec("rclpy") is not None):
        from graspsense_ros2.rclpy_node import RclpyNode

        return RclpyNode(name)
    if find_spec("zenoh") is None:
        raise ConfigError('zenoh cannot be imported: pip install "graspsense[ros2]"')
    from graspsense_ros2.zenoh_node import ZenohNode

    return ZenohNode(name)
