"""The gripper of this distribution. The serial port is imported when a gripper is opened."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper."""
    yield SensorBackendEntry(
        name="robotiq-2f85",
        target="graspsense_robotiq_2f85.backend:Robotiq2F85",
        summary="Robotiq 2F-85 on a serial port, as an example of a gripper of one's own",
        needs="pip install -e ./examples/robotiq_2f85",
    )
