"""The components of this distribution. No driver is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from attrs import evolve

from graspsense.gripper_api import EmulatorEntry, discovery_hooks
from graspsense.plugin_api import PipelineEntry, SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper. Its effort is an estimate from the motor's current."""
    yield SensorBackendEntry(
        name="robotiq",
        target="graspsense_robotiq_2f.backend:RobotiqBackend",
        summary="Robotiq 2F-85, 2F-140 or Hand-E over Modbus RTU or a UR cap; position and motor current",
        needs='pip install "graspsense[robotiq]"; on Linux your user in the group dialout',
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipeline of gripper, controller and features."""
    yield PipelineEntry(
        name="robotiq",
        resource="graspsense_robotiq_2f:pipelines/robotiq.toml",
        summary="a Robotiq gripper, closed by send-and-watch, and the features that need no pads",
    )


@hookimpl
def graspsense_emulators() -> Iterable[EmulatorEntry]:
    """Return the emulated gripper as a device of this machine, and the same with fingertips."""
    gripper = EmulatorEntry(
        name="robotiq",
        target="graspsense_robotiq_2f.emulator.device:emulate",
        summary="a Robotiq gripper's registers, over a simulated gripper",
        wires=("pty", "socket", "ur"),
        options=("gripper.port=emulated",),
        needs='pip install "graspsense[robotiq]"',
    )
    yield gripper
    yield evolve(
        gripper,
        name="tsf85",
        summary="TSF-85 fingertips, on the same emulated gripper",
        options=("gripper.port=emulated", "gripper.tactile_port=emulated"),
        backend="robotiq",
    )


graspsense_probe_devices, graspsense_diagnose = discovery_hooks("graspsense_robotiq_2f.discovery")
