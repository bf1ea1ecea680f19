"""A pipeline: a gripper, a controller, a feature set and a classifier with its model that work together."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from math import nan
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

import numpy as np
from attrs import asdict, evolve, frozen
from attrs.filters import exclude

from graspsense.core.components.caller import set_option
from graspsense.core.components.registry import Component, Plugins, installed
from graspsense.core.components.roles import Controller, FeatureSet, SensorBackend
from graspsense.core.control.garbage_collection import no_collection
from graspsense.core.files.toml_text import toml_value
from graspsense.core.grasp.runner import Grasp, run_grasp
from graspsense.core.grasp.sinks import Sink
from graspsense.core.learn.model import Model
from graspsense.core.learn.model_file import model_in, model_text
from graspsense.core.pipeline.anytime import Anytime, anytime_of
from graspsense.core.pipeline.wiring import check
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import Settings, resolve
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import FAILURES, ConfigError, WiringError, named, place_of
from graspsense.core.values.faults import faults_among
from graspsense.core.values.features import (
    UNKNOWN,
    CheckpointPrediction,
    Features,
    FeatureTable,
    Prediction,
    missing,
)
from graspsense.core.values.signals import GraspEvent, Outcome
from graspsense.core.values.trial import RunInfo, Trial

if TYPE_CHECKING:
    from graspsense.core.grasp.pair import Member

MODELS_KEPT: Final = 4
"""How many models of pipelines stay in memory."""


def model_for(settings: Settings, plugins: Plugins) -> Model | None:
    """Return the model of the classifier of a pipeline; None if the pipeline has no classifier.

    The same content gives the same model, which must not be changed. Raises ConfigError if the pipeline names no model,
    WiringError if the model takes other features than those of the pipeline, and what `load_model` raises.
    """
    chosen = settings.classifier
    if chosen is None:
        return None
    name = getattr(chosen.config, "model", None)
    if name is None:
        raise ConfigError(
            f"classifier {chosen.component.qualified} has no model (classifier.model is not given).\n"
            + _how_to_train(settings, "model.json")
            + f"\n  then use it: {set_option('classifier.model=model.json')}     or do without: "
            f"{set_option('classifier.type=none')}"
        )
    if name.endswith(".json") and not Path(os.path.expanduser(name)).exists():
        raise ConfigError(
            f"there is no model {name} yet (classifier.model).\n"
            + _how_to_train(settings, name)
            + f"\n  or do without: {set_option('classifier.type=none')}"
        )
    model = _kept_model(model_text(name, plugins), name, plugins, chosen.component)
    given = settings.features.declared.features
    misfit = model.misfit(
        FeatureTable(
            names=tuple(feature.name for feature in given),
            units=tuple(feature.unit for feature in given),
            values=np.empty((0, len(given))),
        )
    )
    if misfit:
        raise WiringError(
            f"{misfit}. It could not answer: choose its features, features.type = "
            f"{_features_of(model)}; train a model of these features:\n{_how_to_train(settings, 'model.json')}\n"
            f"  or do without: {set_option('classifier.type=none')}"
        )
    return model


@lru_cache(maxsize=MODELS_KEPT)
def _kept_model(text: bytes, name: str, plugins: Plugins, component: Component) -> Model:
    """Return the model in this text; one that a pipeline used before is not read again."""
    return model_in(text, name, plugins, component)


def _features_of(model: Model) -> str:
    """Return the feature set that a model was trained with, as far as it is known."""
    table = dict(model.provenance.get("settings", {})).get("features") or {}
    return str(table.get("type", "those of its training"))


def _how_to_train(settings: Settings, out: str) -> str:
    """Return the commands that make a model for these settings: of simulated trials where the gripper is simulated."""
    assert settings.classifier is not None
    learner = settings.classifier.component.name
    selected = [] if settings.pipeline == "default" else [f"--pipeline {shlex.quote(settings.pipeline)}"]
    if not selected or settings.origins["gripper.type"].startswith("-"):
        selected.append(f"--gripper {settings.gripper.component.name}")
    for part in (settings.gripper, settings.controller, settings.features):
        table = part.component.table
        for key, value in settings.values[table].items():
            name = f"{table}.{key}"
            if settings.origins.get(name, "").startswith("-o") and name not in (
                "gripper.type",
                "gripper.object",
            ):
                text = part.component.name if key == "type" else toml_value(value)
                selected.append(f"-o {shlex.quote(f'{name}={text}')}")
    selection = " ".join(selected)
    if settings.gripper.create().objects():
        return f"  train one: graspsense train simulated {selection} --classifier {learner} --out {out}"
    return (
        f"  collect trials of this gripper: graspsense collect {selection} --labels can:full,can:empty --save trials\n"
        f"  then train: graspsense train store:trials --classifier {learner} --out {out}"
    )


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
                flags=flags,
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
    backend: SensorBackend[Any] = settings.gripper.create()
    if beside is not None:
        backend = beside.gripper(backend)
    controller, feature_set = settings.controller.create(), settings.features.create()
    anytime = anytime_of(model, feature_set, settings)
    run = RunInfo(
        components=settings.components,
        settings=settings.values,
        seed=settings.run.seed,
        labels=dict(labels or {}),
    )

    def tell(event: GraspEvent) -> None:
        plugins.collect("graspsense_grasp_event", run=run, event=event)
        if on_event is not None:
            on_event(event)

    backend.expect_features(feature_set)
    plugins.collect("graspsense_run_starting", run=run)
    grasp = _grasped(settings, backend, controller, anytime, sinks, tell, on_open)
    checkpoints = () if anytime is None else tuple(anytime.predictions)
    prediction: Prediction | None
    if grasp.outcome == Outcome.RECOGNISED:
        # A model of whole grasps does not know a squeeze that was ended early.
        features, prediction = checkpoints[-1].features, checkpoints[-1].prediction
    else:
        features, prediction = _recognised(settings, feature_set, model, grasp)
    prediction, checkpoints = _as_certain_as_the_gripper(grasp, prediction, checkpoints)
    trial = Trial(
        run=run,
        features=features,
        prediction=prediction,
        checkpoints=checkpoints,
        **asdict(grasp, recurse=False, filter=exclude("interrupted")),
    )
    plugins.collect("graspsense_run_finished", run=run, trial=trial)
    if grasp.interrupted:
        raise GraspInterrupted(trial)
    return trial


def _as_certain_as_the_gripper(
    grasp: Grasp, prediction: Prediction | None, checkpoints: tuple[CheckpointPrediction, ...]
) -> tuple[Prediction | None, tuple[CheckpointPrediction, ...]]:
    """Return the answers without their certainty, which was measured with sound grippers, if this one was not sound."""
    if grasp.outcome == Outcome.DEVICE_LOST:
        why = "the gripper was lost in this grasp"
    elif faults_among(grasp.warnings):
        why = "a fault was seen in this grasp"
    else:
        return prediction, checkpoints
    return (
        None if prediction is None else prediction.without_certainty(why),
        tuple(evolve(early, prediction=early.prediction.without_certainty(why)) for early in checkpoints),
    )


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
