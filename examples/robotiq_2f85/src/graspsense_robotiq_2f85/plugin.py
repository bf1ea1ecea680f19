"""The components of this distribution. The serial port is imported when a gripper is opened."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import (
    FeatureSetEntry,
    PipelineEntry,
    SensorBackendEntry,
    hookimpl,
)

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper. It has no pads: its effort is an estimate from the motor's current."""
    yield SensorBackendEntry(
        name="robotiq-2f85",
        target="graspsense_robotiq_2f85.backend:Robotiq2F85",
        summary="Robotiq 2F-85 over Modbus (RTU on a serial line or TCP, or TCP); position and motor current",
        needs="pip install graspsense-robotiq-2f85; on Linux your user in the group dialout",
    )


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the features that need no pads."""
    yield FeatureSetEntry(
        name="chitta-without-pads",
        target="graspsense_robotiq_2f85.features:WithoutPads",
        summary="the four features of Table I that need no force, with contact from the effort",
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipeline of gripper, controller and features."""
    yield PipelineEntry(
        name="robotiq-2f85",
        resource="graspsense_robotiq_2f85:pipelines/robotiq-2f85.toml",
        summary="a Robotiq 2F-85, closed by send-and-watch, and the features that need no pads",
    )
