"""The model of the classifier of a pipeline, which must fit its features."""

from __future__ import annotations

import shlex
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.components.caller import set_option
from graspsense.core.learn.model import Model
from graspsense.core.learn.model_file import model_in, model_text
from graspsense.core.values.errors import ConfigError, WiringError
from graspsense.core.values.features import FeatureTable

if TYPE_CHECKING:
    from graspsense.core.components.registry import Component, Plugins
    from graspsense.core.settings.resolved import Settings


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
    if name.endswith(".json") and not Path(name).expanduser().exists():
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
    name = settings.classifier.component.name
    selection = f"--gripper {settings.gripper.component.name}"
    if settings.pipeline.endswith(".toml"):
        selection = f"--pipeline {shlex.quote(settings.pipeline)}"
    if settings.origins.get("features.type", "").startswith("-o"):
        selection += f" -o features.type={settings.features.component.name}"
    if settings.gripper.create().objects():
        return f"  train one: graspsense train simulated {selection} --classifier {name} --out {out}"
    return (
        f"  collect trials of this gripper: graspsense collect {selection} --labels can:full,can:empty --save trials\n"
        f"  then train: graspsense train store:trials --classifier {name} --out {out}"
    )
