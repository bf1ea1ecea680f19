"""What this distribution brings to graspsense: LeRobot data sets, and LeRobot robots as grippers."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import DatasetEntry, SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_datasets() -> Iterable[DatasetEntry]:
    """Return the reader of LeRobot data sets."""
    yield DatasetEntry(
        name="lerobot",
        recordings="graspsense_lerobot.reader:recordings",
        export="graspsense_lerobot.export:export",
        summary="LeRobot data sets v2.1 and v3.0, as lerobot:FOLDER",
    )


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper."""
    yield SensorBackendEntry(
        name="lerobot",
        target="graspsense_lerobot.backend:LeRobotBackend",
        summary="one motor of a robot that LeRobot knows; position, and load or current by its motor bus",
        needs="pip install lerobot (it brings PyTorch)",
    )
