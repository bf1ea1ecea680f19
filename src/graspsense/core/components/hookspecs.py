"""The hooks that a plugin can implement. Component hooks return entries; observer hooks return nothing.

A plugin implements hooks as module functions marked with `graspsense.plugin_api.hookimpl`, in the module that its entry
point in the group `graspsense.plugins` names. No hook depends on the order of plugins, and none can change a run. The
example of a hook that returns entries is the statement of its implementation that yields one.
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
    from graspsense.core.values.signals import GraspEvent
    from graspsense.core.values.trial import RunInfo, Trial

PROJECT = "graspsense"
ENTRY_POINT_GROUP = "graspsense.plugins"
API = (2, 0)
"""Version of these hooks. A plugin's `GRASPSENSE_API` must have the same major number and a minor number not larger."""

hookspec = pluggy.HookspecMarker(PROJECT)
hookimpl = pluggy.HookimplMarker(PROJECT)


@hookspec
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:  # type: ignore[empty-body]
    """Return the [grippers](sensor-backend.md) of this plugin."""


@hookspec
def graspsense_controllers() -> Iterable[ControllerEntry]:  # type: ignore[empty-body]
    """Return the [control laws](controller.md) of this plugin."""


@hookspec
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:  # type: ignore[empty-body]
    """Return the [feature sets](feature-set.md) of this plugin.

    `Feature(..., width=True)` marks the feature that is the width of the object.
    """


@hookspec
def graspsense_classifiers() -> Iterable[ClassifierEntry]:  # type: ignore[empty-body]
    """Return the [classifiers](classifier.md) of this plugin.

    A classifier always predicts a label that it was trained on: unknown trials are detected by [one
    rule](../evaluation.md#when-a-trial-is-unknown) for all.
    """


@hookspec
def graspsense_pipelines() -> Iterable[PipelineEntry]:  # type: ignore[empty-body]
    """Return the pipeline files that this plugin ships, for `--pipeline NAME` and `extends = "NAME"`.

    A file must be in the wheel.

    Example::

        yield PipelineEntry(
            name="lab",
            resource="lab_hand:pipelines/lab.toml",
            summary="our hand, with hybrid control",
        )
    """


@hookspec
def graspsense_models() -> Iterable[ModelEntry]:  # type: ignore[empty-body]
    """Return the trained models that this plugin ships, as JSON files.

    Example::

        yield ModelEntry(
            name="lab-cans",
            resource="lab_hand:models/cans.json",
            summary="open and closed cans, trained on 400 grasps of our hand",
        )
    """


@hookspec
def graspsense_datasets() -> Iterable[DatasetEntry]:  # type: ignore[empty-body]
    """Return the [readers of recorded data](dataset.md) of this plugin, which the command line calls `NAME:FOLDER`.

    A data set with features of its own names a function `read(folder, features, *, unreliable) -> Labelled` as
    `target`: `features` is the feature set for traces, and `unreliable` says whether to include trials that the
    author of the data calls unreliable.
    """


@hookspec
def graspsense_commands() -> Iterable[CommandEntry]:  # type: ignore[empty-body]
    """Return further subcommands of `graspsense`.

    The commands of graspsense itself keep their names. A plugin command with the same name is called `graspsense
    DISTRIBUTION/NAME`.

    Example::

        yield CommandEntry(
            name="home-hand",
            target="lab_hand.cli:home",
            summary="move our hand to its home position",
        )
    """


@hookspec
def graspsense_emulators() -> Iterable[EmulatorEntry]:  # type: ignore[empty-body]
    """Return the devices that `graspsense emulate NAME` can present as devices of the operating system.

    `wire` is one of `wires`, or empty for the first that is available. If none is, the function raises `NoDevice`
    and says what each one lacks. The device must disappear with its process, however that ends.

    Example::

        yield EmulatorEntry(
            name="lab-hand",
            target="lab_hand.emulator:emulate",
            summary="our hand, behind a pseudo terminal",
            wires=("pty",),
        )
    """


@hookspec
def graspsense_identifiers() -> Iterable[IdentifierEntry]:  # type: ignore[empty-body]
    """Return functions that identify an object from recorded squeezes, for `graspsense identify`.

    `block` may be empty.

    Example::

        yield IdentifierEntry(
            name="lab-sim",
            target="lab_sim.identification:identify",
            summary="stiffness and width, as a scene of our simulator",
        )
    """


@hookspec
def graspsense_live_observers() -> Iterable[LiveObserverEntry]:  # type: ignore[empty-body]
    """Return functions that receive grasps while they go on, for `--live`, each in a process of its own.

    [What they receive](../live.md#an-observer-of-your-own) has a page. No tick waits for an observer, however it
    fails.

    Example::

        yield LiveObserverEntry(
            name="lab-wall",
            target="lab_hand.wall:observe",
            summary="the screen on the wall of our lab",
        )
    """


@hookspec
def graspsense_experiment_kinds() -> Iterable[ExperimentKindEntry]:  # type: ignore[empty-body]
    """Return the kinds of experiments of this plugin, which an experiment file selects by `kind`.

    `run(params, seed)` computes one task: `params` holds the resolved settings, the source of trials, the
    classifiers and the keys under `[judge]` as JSON values.

    Example::

        yield ExperimentKindEntry(
            name="wear",
            run="lab_study.wear:run",
            keys="lab_study.wear:WearSettings",
            result="lab_study.wear:WearResult",
            findings="lab_study.wear:findings",
            summary="how a bottle changes from squeeze to squeeze",
        )
    """


@hookspec
def graspsense_experiments() -> Iterable[ExperimentEntry]:  # type: ignore[empty-body]
    """Return the experiment files that this plugin ships, for `graspsense experiment NAME`.

    Example::

        yield ExperimentEntry(name="worn-cans", resource="lab_study:experiments/worn_cans.toml")
    """


@hookspec
def graspsense_conformance_checks() -> Iterable[ConformanceCheckEntry]:  # type: ignore[empty-body]
    """Return checks of what other plugins return from a hook that this plugin defines.

    `graspsense plugins check DISTRIBUTION` runs them. `target` is a function that takes the list of these values of
    one distribution, and yields a sentence for each defect.

    Example::

        yield ConformanceCheckEntry(
            name="fingers-have-names",
            target="lab_hand.checks:check_fingers",
            hook="lab_hand_fingers",
            summary="every finger has a name of its own",
        )
    """


@hookspec
def graspsense_probe_devices(timeout_s: float) -> Iterable[FoundDevice]:  # type: ignore[empty-body]
    """Search for devices for at most `timeout_s` seconds.

    Only `graspsense devices` calls it, so it may import drivers. `ready` says whether the device can be opened now;
    `advice` says what to do if not.

    Example::

        yield FoundDevice(
            backend="lab-hand",
            serial="0042",
            where="/dev/ttyUSB0",
            ready=False,
            advice="add yourself to the group dialout",
        )
    """


@hookspec
def graspsense_diagnose(config: object, timeout_s: float) -> Iterable[Finding]:  # type: ignore[empty-body]
    """Examine the connected devices: permissions, libraries, rate and latency, age of calibrations.

    Only `graspsense doctor` calls it, so it may import drivers. `config` is that of the gripper that the user
    named, or None; it may belong to another plugin. Each device may be opened for about `timeout_s` seconds, but
    nothing may move. A `problem` makes the exit code 1; an exception is reported as one of this plugin.

    Example::

        yield Finding(
            subject="serial line",
            state="problem",
            words="no permission on /dev/ttyUSB0",
            advice="add yourself to the group dialout",
            numbers={"baud": 115200},
        )
    """


@hookspec
def graspsense_run_starting(run: RunInfo) -> None:
    """Observe that a grasp is about to start.

    Example::

        from graspsense.plugin_api import hookimpl

        started = []


        @hookimpl
        def graspsense_run_starting(run):
            started.append(run.seed)
    """


@hookspec
def graspsense_grasp_event(run: RunInfo, event: GraspEvent) -> None:
    """Observe a change of phase, an action of the guard, or an event that the controller tells.

    In the last case `source` is `controller`, and `what` the name of the event.

    Example::

        from graspsense.plugin_api import hookimpl

        events = []


        @hookimpl
        def graspsense_grasp_event(event):
            events.append(event.what)
    """


@hookspec
def graspsense_run_finished(run: RunInfo, trial: Trial) -> None:
    """Observe the finished trial, whatever its outcome.

    Example::

        from graspsense.plugin_api import hookimpl

        outcomes = []


        @hookimpl
        def graspsense_run_finished(trial):
            outcomes.append(trial.outcome.words)
    """
