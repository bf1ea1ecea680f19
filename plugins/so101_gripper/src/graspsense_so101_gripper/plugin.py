"""The components of this distribution. No driver is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.gripper_api import EmulatorEntry, discovery_hooks
from graspsense.plugin_api import PipelineEntry, SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the gripper. Its effort is an estimate from the load or the current of its motor."""
    yield SensorBackendEntry(
        name="so101",
        target="graspsense_so101_gripper.backend:So101Backend",
        summary="the gripper of an SO-101 arm (Feetech STS3215 on a serial bus); position, load and current",
        needs='pip install "graspsense[so101]"; on Linux your user in the group dialout',
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipeline of gripper, controller and features."""
    yield PipelineEntry(
        name="so101",
        resource="graspsense_so101_gripper:pipelines/so101.toml",
        summary="the gripper of an SO-101 arm, closed by send-and-watch, and the features that need no pads",
    )


@hookimpl
def graspsense_emulators() -> Iterable[EmulatorEntry]:
    """Return the emulated arm as a device of this machine."""
    yield EmulatorEntry(
        name="so101",
        target="graspsense_so101_gripper.emulator.arm:emulate",
        summary="the six motors of an SO-101 arm on a serial bus, over a simulated gripper",
        wires=("pty",),
        options=("gripper.port=emulated",),
        needs='pip install "graspsense[so101]"',
    )


graspsense_probe_devices, graspsense_diagnose = discovery_hooks("graspsense_so101_gripper.discovery")
