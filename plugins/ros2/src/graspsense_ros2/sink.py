"""Grasps as ROS 2 topics while they go on: what a live observer of graspsense publishes."""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import prod
from typing import Any, Final

import numpy as np

from graspsense_ros2.message_types import encode, message, packed
from graspsense_ros2.middleware import open_node
from graspsense_ros2.node import Node

JOINT_STATE: Final = "sensor_msgs/msg/JointState"
WRENCH: Final = "geometry_msgs/msg/WrenchStamped"
ARRAY: Final = "std_msgs/msg/Float64MultiArray"
NUMBER: Final = "std_msgs/msg/Float64"
TEXT: Final = "std_msgs/msg/String"
NODE_NAME: Final = "graspsense"
BELOW: Final = f"/{NODE_NAME}/"
"""Before the name of every topic."""
JOINT: Final = "gap"
_NS: Final = 1_000_000_000
_LATCHED: Final = ("prediction", "outcome")
Batches = Iterable[Sequence[Mapping[str, Any]]]


def observe(batches: Batches) -> None:
    """Publish grasps until the grasping program ends. Raises ConfigError if there is no node."""
    node = open_node(NODE_NAME)
    try:
        publish_grasps(node, batches)
    finally:
        node.close()


def publish_grasps(node: Node, batches: Batches) -> None:
    """Publish the messages of a live observer on this node."""
    topics = GraspTopics(node)
    for messages in batches:
        for each in messages:
            topics.publish(each)


class GraspTopics:
    """The topics of grasps; each is declared when it has its first message."""

    def __init__(self, node: Node) -> None:
        self._node = node
        self._publishers: dict[str, Callable[[bytes], None]] = {}
        self._began_s: float | None = None
        self._channels: dict[str, Mapping[str, Any]] = {}
        # A tick fills these again, which is quicker than new ones.
        self._joint = message(JOINT_STATE, {"name": [JOINT], **{name: [0.0] for name in _JOINT_FIELDS}})
        self._wrenches = [message(WRENCH, {"header": {"frame_id": side}}) for side in ("left", "right")]

    def publish(self, live: Mapping[str, Any]) -> None:
        """Publish a message of a live observer; one of a kind that has no topic is left out."""
        kind = live["kind"]
        if kind == "grasp":
            self._began_s = None
            self._channels = {channel["name"]: channel for channel in live["channels"]}
        elif kind == "ticks":
            self._ticks(live)
        elif kind == "scalars":
            for name in live.keys() - {"kind", "t_s"}:
                for value in live[name]:
                    self._send(f"signals/{name}", NUMBER, encode(NUMBER, {"data": value}))
        elif kind == "image":
            name = live["name"]
            channel = self._channels.get("pads" if name.startswith("pads_") else name, {})
            self._array(f"tactile/{name}", live["cells"], _shape(channel, live["cells"]))
        elif kind == "samples":
            for rows in live["values"]:
                if rows:
                    self._array(f"signals/{live['name']}", rows, {"samples": len(rows), "axes": len(rows[0])})
        elif kind == "event" or kind in _LATCHED:
            text = json.dumps({key: value for key, value in live.items() if key != "kind"})
            topic = "events" if kind == "event" else kind
            self._send(topic, TEXT, encode(TEXT, {"data": text}), latched=kind in _LATCHED)

    def _ticks(self, columns: Mapping[str, Any]) -> None:
        if self._began_s is None:
            self._began_s = time.time() - columns["t_s"][-1]
        joint, sides = self._joint, (columns["force_left_n"], columns["force_right_n"])
        kinematic = [columns[name] for name in _JOINT_FIELDS.values()]
        for k, t_s in enumerate(columns["t_s"]):
            sec, nanosec = divmod(int((self._began_s + t_s) * _NS), _NS)
            joint.header.stamp.sec, joint.header.stamp.nanosec = sec, nanosec
            joint.position[0], joint.velocity[0], joint.effort[0] = (values[k] for values in kinematic)
            self._send("joint_states", JOINT_STATE, packed(JOINT_STATE, joint))
            for wrench, forces in zip(self._wrenches, sides, strict=True):
                if forces[k] == forces[k]:
                    wrench.header.stamp.sec, wrench.header.stamp.nanosec = sec, nanosec
                    wrench.wrench.force.z = forces[k]
                    self._send(f"wrench/{wrench.header.frame_id}", WRENCH, packed(WRENCH, wrench))

    def _array(self, topic: str, values: Any, shape: Mapping[str, int]) -> None:
        numbers = np.ravel(values)
        sizes = list(shape.values())
        dimensions = [
            {"label": label, "size": size, "stride": prod(sizes[place:])}
            for place, (label, size) in enumerate(shape.items())
        ]
        self._send(topic, ARRAY, encode(ARRAY, {"layout": {"dim": dimensions}, "data": numbers}))

    def _send(self, topic: str, type_name: str, data: bytes, latched: bool = False) -> None:
        publish = self._publishers.get(topic)
        if publish is None:
            publish = self._publishers[topic] = self._node.publisher(BELOW + topic, type_name, latched)
        publish(data)


_JOINT_FIELDS: Final = {"position": "gap_m", "velocity": "velocity_m_s", "effort": "effort_n"}
"""The fields of a joint state with the columns of ticks."""


def _shape(channel: Mapping[str, Any], cells: Sequence[Any]) -> dict[str, int]:
    """Return the dimensions of an image: rows, columns and components where the channel declares them."""
    rows, columns = channel.get("rows", 0), channel.get("columns", 0)
    components = channel.get("components", 1)
    count = int(np.size(cells))
    if rows * columns * components != count:
        return {"cells": count}
    shape = {"rows": rows, "columns": columns}
    return shape if components == 1 else {**shape, "components": components}
