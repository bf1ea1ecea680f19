"""A pipeline: a gripper, a controller, a feature set and a classifier that work together."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any

from attrs import frozen

from graspsense.core.components.registry import Plugins, installed
from graspsense.core.components.roles import Controller, FeatureSet, SensorBackend
from graspsense.core.control.garbage_collection import no_collection
from graspsense.core.grasp.runner import Grasp, run_grasp
from graspsense.core.grasp.sinks import Sink
from graspsense.core.learn.model import Model
from graspsense.core.pipeline.anytime import Anytime, anytime_of
from graspsense.core.pipeline.pipeline_model import model_for
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import FAILURES, named, place_of
from graspsense.core.values.events import GraspEvent
from graspsense.core.values.features import UNKNOWN, Features, Prediction, missing
from graspsense.core.values.signals import Outcome
from graspsense.core.values.trial import RunInfo, Trial

if TYPE_CHECKING:
    from graspsense.core.grasp.pair import Member


class GraspInterrupted(KeyboardInterrupt):
    """The user asked for an end during a grasp. The gripper was released; `trial` is what was measured until then."""

    def __init__(self, trial: Trial) -> None:
        super().__init__()
        self.trial = trial


@frozen(eq=False, kw_only=True)
class Pipeline:
    """A resolved and checked pipeline. Only `grasp` opens the gripper."""

    settings: Settings
    options: tuple[str, ...] = ()
    plugins: Plugins

    def grasp(
        self,
        *,
        object: str | None = None,
        seed: int | None = None,
        labels: Mapping[str, str] | None = None,
        sinks: Iterable[Sink] = (),
        on_event: Callable[[GraspEvent], None] | None = None,
    ) -> Trial:
        """Run one grasp and return the trial, whatever its outcome.

        `object` and `seed` override `gripper.object` and `run.seed`. Raises ConfigError if the gripper has no setting
        `object`, UnknownName for an unknown object, NoDevice if the gripper is not connected, and GraspInterrupted,
        which has the trial, on Ctrl-C, so that a loop over grasps ends too.
        """
        if object is not None or seed is not None:
            flags = (Flag("object", "gripper.object", object), Flag("seed", "run.seed", seed))
            settings = resolve(
                self.settings.pipeline,
                plugins=self.plugins,
                options=self.options,
                flags=[flag for flag in flags if flag.value is not None],
                force=True,  # these settings have been accepted
            )
        else:
            settings = self.settings
        return grasp_with(settings, self.plugins, labels=labels, sinks=sinks, on_event=on_event)


def load_pipeline(
    pipeline: str | Path = "default",
    *,
    options: Sequence[str] = (),
    plugins: Plugins | None = None,
    force: bool = False,
) -> Pipeline:
    """Return a pipeline by name or file, with options as after `-o` (`"controller.probing_force_n=17"`).

    `force` accepts values outside of their plausible ranges.

    Raises ConfigError that lists all errors, WiringError if the components do not fit together.
    """
    plugins = installed() if plugins is None else plugins
    settings = resolve(str(pipeline), plugins=plugins, options=options, force=force)
    check(settings)
    return Pipeline(settings=settings, options=tuple(options), plugins=plugins)


def grasp_with(
    settings: Settings,
    plugins: Plugins,
    *,
    labels: Mapping[str, str] | None = None,
    sinks: Iterable[Sink] = (),
    on_event: Callable[[GraspEvent], None] | None = None,
    on_open: Callable[[DeviceInfo], None] | None = None,
    beside: Member | None = None,
) -> Trial:
    """Run one grasp with these settings: build the components, grasp, extract features, predict, notify observers.

    `beside` makes its gripper the one of a pair (`run_pair`). Raises GraspInterrupted, which has the trial,
    if the user asked for an end; the gripper was then released.
    """
    # The model is loaded first, because a missing model must be reported before the grasp.
    model = model_for(settings, plugins)
    backend, controller = _gripper(settings, beside), settings.controller.create()
    feature_set = settings.features.create()
    anytime = anytime_of(model, feature_set, settings)
    run = _run_info(settings, labels)

    def tell(event: GraspEvent) -> None:
        plugins.grasp_event(run, event)
        if on_event is not None:
            on_event(event)

    backend.expect_features(feature_set)
    plugins.run_starting(run)
    grasp = _grasped(settings, backend, controller, anytime, sinks, tell, on_open)
    checkpoints = () if anytime is None else tuple(anytime.predictions)
    prediction: Prediction | None
    if grasp.outcome == Outcome.RECOGNISED:
        # A model of whole grasps does not know a squeeze that was ended early.
        features, prediction = checkpoints[-1].features, checkpoints[-1].prediction
    else:
        features, prediction = _recognised(settings, feature_set, model, grasp)
    trial = Trial(
        run=run,
        trace=grasp.trace,
        outcome=grasp.outcome,
        reason=grasp.reason,
        features=features,
        prediction=prediction,
        device=grasp.device,
        report=grasp.report,
        counts=grasp.counts,
        events=grasp.events,
        seconds_simulated=grasp.seconds_simulated,
        seconds_wall=grasp.seconds_wall,
        checkpoints=checkpoints,
        warnings=grasp.warnings,
    )
    plugins.run_finished(run, trial)
    if grasp.interrupted:
        raise GraspInterrupted(trial)
    return trial


def _run_info(settings: Settings, labels: Mapping[str, str] | None) -> RunInfo:
    return RunInfo(
        components=settings.components,
        settings=settings.values,
        seed=settings.run.seed,
        labels=dict(labels or {}),
    )


def _gripper(settings: Settings, beside: Member | None) -> SensorBackend[Any]:
    backend: SensorBackend[Any] = settings.gripper.create()
    return backend if beside is None else beside.gripper(backend)


def _grasped(
    settings: Settings,
    backend: SensorBackend[Any],
    controller: Controller[Any],
    anytime: Anytime | None,
    sinks: Iterable[Sink],
    tell: Callable[[GraspEvent], None],
    on_open: Callable[[DeviceInfo], None] | None,
) -> Grasp:
    # Until the ticks are let go, so that no collection looks at each of them.
    with no_collection():
        try:
            return run_grasp(
                backend,
                controller,
                settings.run,
                sinks=sinks,
                on_event=tell,
                on_open=on_open,
                watcher=anytime,
            )
        finally:
            if anytime is not None:
                anytime.end()


def _recognised(
    settings: Settings, feature_set: FeatureSet[Any], model: Model | None, grasp: Grasp
) -> tuple[Features, Prediction | None]:
    """Return the features and the prediction of a whole grasp; its trace is kept whatever fails here."""
    try:
        features = feature_set.extract(grasp.trace)
        if not isinstance(features, Features):
            raise TypeError(
                f"extract returned {type(features).__name__}: return graspsense.plugin_api.Features"
            )
    except FAILURES as error:
        why = f"{settings.features.component.qualified} failed: {named(error)}{place_of(error)}"
        features = _undefined(settings, why)
    if model is None:
        return features, None
    try:
        return features, model.predict(features, settings, grasp.device)
    except FAILURES as error:
        why = f"{model.component} failed: {named(error)}{place_of(error)}"
        return features, Prediction(label=UNKNOWN, probabilities={}, because=(why,))


def _undefined(settings: Settings, why: str) -> Features:
    """Return the declared features of the feature set, all missing for this reason."""
    features = settings.features.declared.features
    names = tuple(feature.name for feature in features)
    units = tuple(feature.unit for feature in features)
    return Features(names=names, values=(nan,) * len(names), units=units, reasons=missing(names, why))
