"""The components of this distribution. Neither zenoh nor ROS is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.gripper_api import LiveObserverEntry
from graspsense.plugin_api import CommandEntry, SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)
_NEEDS = 'pip install "graspsense[ros2]"'


@hookimpl
def graspsense_live_observers() -> Iterable[LiveObserverEntry]:
    """Return what publishes grasps as topics."""
    yield LiveObserverEntry(
        name="ros2",
        target="graspsense_ros2.sink:observe",
        summary="grasps as ROS 2 topics below /graspsense",
        needs=_NEEDS,
    )


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper of a robot that runs ROS 2."""
    yield SensorBackendEntry(
        name="ros2",
        target="graspsense_ros2.backend:Ros2Backend",
        summary="a gripper behind ROS 2: gap and forces from topics, moved by a GripperCommand action",
        needs=_NEEDS,
    )


@hookimpl
def graspsense_commands() -> Iterable[CommandEntry]:
    """Return the node that grasps when it is asked."""
    yield CommandEntry(
        name="ros2",
        target="graspsense_ros2.command:ros2",
        summary="Be a ROS 2 node that grasps when it is asked.",
    )
