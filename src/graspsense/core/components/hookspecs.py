"""The hooks that a plugin can implement. Component hooks return entries; observer hooks return nothing.

A plugin implements hooks as module functions marked with `graspsense.plugin_api.hookimpl`, in the module that its entry
point in the group `graspsense.plugins` names. No hook depends on the order of plugins, and none can change a run.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

import pluggy

from graspsense.core.components.entries import (
    ClassifierEntry,
    CommandEntry,
    ConformanceCheckEntry,
    ControllerEntry,
    DatasetEntry,
    EmulatorEntry,
    ExperimentEntry,
    ExperimentKindEntry,
    FeatureSetEntry,
    Finding,
    FoundDevice,
    IdentifierEntry,
    LiveObserverEntry,
    ModelEntry,
    PipelineEntry,
    SensorBackendEntry,
)

if TYPE_CHECKING:
    from graspsense.core.values.events import GraspEvent
    from graspsense.core.values.trial import RunInfo, Trial

PROJECT = "graspsense"
ENTRY_POINT_GROUP = "graspsense.plugins"
API = (2, 0)
"""Version of these hooks. A plugin's `GRASPSENSE_API` must have the same major number and a minor number not larger."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:  # type: ignore[empty-body]
    """Return the grippers of this plugin."""


@hookspec
def graspsense_controllers() -> Iterable[ControllerEntry]:  # type: ignore[empty-body]
    """Return the control laws of this plugin."""


@hookspec
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:  # type: ignore[empty-body]
    """Return the feature sets of this plugin."""


@hookspec
def graspsense_classifiers() -> Iterable[ClassifierEntry]:  # type: ignore[empty-body]
    """Return the classifiers of this plugin."""


@hookspec
def graspsense_pipelines() -> Iterable[PipelineEntry]:  # type: ignore[empty-body]
    """Return the pipeline files that this plugin ships."""


@hookspec
def graspsense_models() -> Iterable[ModelEntry]:  # type: ignore[empty-body]
    """Return the trained models that this plugin ships."""


@hookspec
def graspsense_datasets() -> Iterable[DatasetEntry]:  # type: ignore[empty-body]
    """Return the readers of recorded data of this plugin."""


@hookspec
def graspsense_commands() -> Iterable[CommandEntry]:  # type: ignore[empty-body]
    """Return further subcommands of `graspsense`."""


@hookspec
def graspsense_emulators() -> Iterable[EmulatorEntry]:  # type: ignore[empty-body]
    """Return the devices that this plugin can emulate as devices of the operating system."""


@hookspec
def graspsense_identifiers() -> Iterable[IdentifierEntry]:  # type: ignore[empty-body]
    """Return functions that identify objects from recorded squeezes."""


@hookspec
def graspsense_live_observers() -> Iterable[LiveObserverEntry]:  # type: ignore[empty-body]
    """Return functions that receive grasps while they go on, each in a process of its own."""


@hookspec
def graspsense_experiment_kinds() -> Iterable[ExperimentKindEntry]:  # type: ignore[empty-body]
    """Return the kinds of experiments of this plugin."""


@hookspec
def graspsense_experiments() -> Iterable[ExperimentEntry]:  # type: ignore[empty-body]
    """Return the experiment files that this plugin ships."""


@hookspec
def graspsense_conformance_checks() -> Iterable[ConformanceCheckEntry]:  # type: ignore[empty-body]
    """Return checks of what other plugins return from the hooks that this plugin owns."""


@hookspec
def graspsense_probe_devices(timeout_s: float) -> Iterable[FoundDevice]:  # type: ignore[empty-body]
    """Search for devices for at most `timeout_s` seconds. May import drivers: only `graspsense devices` calls it."""


@hookspec
def graspsense_diagnose(config: object, timeout_s: float) -> Iterable[Finding]:  # type: ignore[empty-body]
    """Examine the connected devices and why they fail. May import drivers: only `graspsense doctor` calls it."""


@hookspec
def graspsense_run_starting(run: RunInfo) -> None:
    """Observe that a grasp is about to start."""


@hookspec
def graspsense_grasp_event(run: RunInfo, event: GraspEvent) -> None:
    """Observe a change of phase, or an action of the guard."""


@hookspec
def graspsense_run_finished(run: RunInfo, trial: Trial) -> None:
    """Observe the finished trial, whatever its outcome."""
