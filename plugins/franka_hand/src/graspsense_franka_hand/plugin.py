"""The components of this distribution. No driver is imported here."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.gripper_api import EmulatorEntry, discovery_hooks
from graspsense.plugin_api import FeatureSetEntry, PipelineEntry, SensorBackendEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the hand. It measures no force."""
    yield SensorBackendEntry(
        name="franka",
        target="graspsense_franka_hand.backend:FrankaBackend",
        summary="Franka Hand through pylibfranka; width, grasped and temperature, no force",
        needs='pip install "graspsense[franka]" "graspsense-franka-hand[pylibfranka]" (wheels for Linux on x86_64)',
    )


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the features of width and time."""
    yield FeatureSetEntry(
        name="width-and-time",
        target="graspsense_franka_hand.features:WidthAndTime",
        summary="width at contact and at rest, what the squeeze changed, and its time: no force is needed",
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipeline of hand, controller and features."""
    yield PipelineEntry(
        name="franka",
        resource="graspsense_franka_hand:pipelines/franka.toml",
        summary="a Franka Hand, closed by send-and-watch, and the features of width and time",
    )


@hookimpl
def graspsense_emulators() -> Iterable[EmulatorEntry]:
    """Return the emulated hand as a device of this machine's network."""
    yield EmulatorEntry(
        name="franka",
        target="graspsense_franka_hand.emulator.device:emulate",
        summary="the network protocol of a Franka Hand, over a simulated gripper",
        wires=("network",),
        options=("gripper.host=emulated",),
        needs='pip install "graspsense[franka]"',
    )


graspsense_probe_devices, graspsense_diagnose = discovery_hooks("graspsense_franka_hand.discovery")
