"""The components of this distribution. No driver is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.gripper_api import EmulatorEntry, discovery_hooks
from graspsense.plugin_api import SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the PR2 gripper."""
    yield SensorBackendEntry(
        name="pr2",
        target="graspsense_pr2_gripper.backend:Pr2Backend",
        summary="PR2 gripper with fingertip pressure arrays, over USB HID",
        needs='pip install "graspsense[pr2]"; on Linux also a udev rule (graspsense doctor)',
    )


@hookimpl
def graspsense_emulators() -> Iterable[EmulatorEntry]:
    """Return the emulated board as a device of this machine."""
    yield EmulatorEntry(
        name="pr2",
        target="graspsense_pr2_gripper.emulator.board:emulate",
        summary="the PR2 gripper's board, over a simulated gripper",
        wires=("uhid", "usb"),
        options=("gripper.transport=emulated",),
        needs='pip install "graspsense[pr2]"',
    )


graspsense_probe_devices, graspsense_diagnose = discovery_hooks("graspsense_pr2_gripper.diagnosis")
