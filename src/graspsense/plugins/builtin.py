"""The components of graspsense itself, registered by the same hooks as those of any plugin."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from graspsense.plugin_api import (
    CHANNELS,
    Channel,
    ClassifierEntry,
    ControllerEntry,
    DatasetEntry,
    Feature,
    FeatureSetEntry,
    PipelineEntry,
    SensorBackendEntry,
    hookimpl,
)

GRASPSENSE_API = (1, 0)

_PAD_FORCES: Final = (Channel("force_left", "N"), Channel("force_right", "N"))


@hookimpl
def graspsense_controllers() -> Iterable[ControllerEntry]:
    """Return the controller of the paper, and the two that it consists of."""
    for name, summary in (
        ("velocity", "PI control of the gap's rate, whatever is in the way"),
        ("force", "constant effort, or closed loop on the pad force, from the start"),
        ("hybrid", "velocity control until both pads touch, then force control"),
    ):
        yield ControllerEntry(
            name=name,
            target=f"graspsense.plugins.controllers.{name}:{name.capitalize()}Controller",
            config=f"graspsense.plugins.controllers.{name}:{name.capitalize()}Config",
            summary=summary,
            requires=(Channel("gap", "m"), Channel("velocity", "m/s"), *_PAD_FORCES),
            commands=("effort",),
            alternatives=() if name == "force" else ("velocity",),
        )


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the six features of Table I of the paper."""
    yield FeatureSetEntry(
        name="chitta",
        target="graspsense.plugins.features.chitta:ChittaFeatures",
        config="graspsense.plugins.features.chitta:ChittaConfig",
        summary="the six features of Table I (Chitta, Piccoli, Sturm 2010)",
        requires=(Channel("gap", "m"), *_PAD_FORCES),
        features=(
            Feature("p_first", "m", "gap at the first contact of both fingers", width=True),
            Feature("p_steady", "m", "gap when the fingers have come to rest"),
            Feature("f_steady", "N", "force on the pads when the fingers have come to rest"),
            Feature("delta_t", "s", "time from the first contact to rest"),
            Feature("dp_dt", "m/s", "mean rate of the gap from the first contact to rest"),
            Feature("df_dt", "N/s", "mean rate of the pad force from the first contact to rest"),
        ),
    )


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the backend that replays a recording."""
    yield SensorBackendEntry(
        name="replay",
        target="graspsense.sources.replay:ReplayBackend",
        config="graspsense.sources.replay:ReplayConfig",
        summary="a recording instead of a gripper; a channel it lacks is NaN",
        channels=tuple(Channel(name, unit) for name, unit in CHANNELS.items()),
        accepts=("effort", "velocity", "position", "force"),
    )


@hookimpl
def graspsense_classifiers() -> Iterable[ClassifierEntry]:
    """Return classifiers of scikit-learn. C4.5, which the paper uses, is in another distribution."""
    for name, config, summary in (
        ("svm", "Svm", "support vector machine with a radial kernel (scikit-learn)"),
        ("mlp", "Mlp", "neural network with one hidden layer (scikit-learn)"),
        ("forest", "Forest", "random forest (scikit-learn)"),
        ("knn", "Knn", "nearest neighbours (scikit-learn)"),
        ("tree", "Cart", "binary decision tree, CART (scikit-learn)"),
    ):
        yield ClassifierEntry(
            name=name,
            target=f"graspsense.plugins.classifiers.{name}:{config}",
            config=f"graspsense.plugins.classifiers.{name}:{config}Config",
            summary=summary,
        )


@hookimpl
def graspsense_datasets() -> Iterable[DatasetEntry]:
    """Return the readers of recorded data."""
    yield DatasetEntry(
        name="icub",
        target="graspsense.sources.icub_dataset:read_dataset",
        summary="iCub Grasp Dataset (Soh, Su and Demiris 2012), as icub:FOLDER",
    )
    yield DatasetEntry(
        name="store",
        target="graspsense.store.dataset:read_dataset",
        summary="labelled trials of a store, as store:FOLDER",
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the default pipeline."""
    yield PipelineEntry(
        name="default",
        resource="graspsense:plugins/pipelines/default.toml",
        summary="simulated gripper, hybrid control, the six features of Table I",
    )
