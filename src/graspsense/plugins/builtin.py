"""The components of graspsense itself, registered by the same hooks as those of any plugin."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.experiment_api import ExperimentEntry, ExperimentKindEntry
from graspsense.plugin_api import (
    ClassifierEntry,
    ControllerEntry,
    DatasetEntry,
    FeatureSetEntry,
    PipelineEntry,
    SensorBackendEntry,
    hookimpl,
)

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_controllers() -> Iterable[ControllerEntry]:
    """Return the controller of the paper, its two parts, and one for grippers that close by themselves."""
    for name, summary in (
        ("velocity", "PI control of the gap's rate, whatever is in the way"),
        ("force", "constant effort, or closed loop on the pad force, from the start"),
        ("hybrid", "velocity control until both pads touch, then force control"),
    ):
        yield ControllerEntry(
            name=name,
            target=f"graspsense.plugins.controllers.{name}:{name.capitalize()}Controller",
            summary=summary,
        )
    yield ControllerEntry(
        name="send-and-watch",
        target="graspsense.plugins.controllers.send_and_watch:SendAndWatchController",
        summary="for a gripper that closes by itself: a target with speed and force, raised in steps from the contact",
    )


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the six features of Table I of the paper, and those of the whole force curve by two sets."""
    yield FeatureSetEntry(
        name="chitta",
        target="graspsense.plugins.features.chitta:ChittaFeatures",
        summary="the six features of Table I (Chitta, Piccoli, Sturm 2010)",
    )
    yield FeatureSetEntry(
        name="chitta-without-pads",
        target="graspsense.plugins.features.without_pads:WithoutPads",
        summary="the four features of Table I that need no force, with contact from the effort",
    )
    yield FeatureSetEntry(
        name="curve",
        target="graspsense.plugins.features.curve:CurveFeatures",
        summary="stiffness, work, relaxation, hysteresis and shape of the whole force curve",
    )
    yield FeatureSetEntry(
        name="quantiles",
        target="graspsense.plugins.features.quantiles:QuantileFeatures",
        summary="quantiles of gap, forces and their rates over the contact and its halves",
    )
    yield FeatureSetEntry(
        name="quant",
        target="graspsense.plugins.features.quant:QuantFeatures",
        summary="quantiles of gap, forces, their rates and spectrum on many intervals of the whole recording",
    )
    yield FeatureSetEntry(
        name="catch22",
        target="graspsense.plugins.features.catch22:Catch22Features",
        summary="22 characteristics of the force over time (pycatch22)",
        needs="pip install 'graspsense[catch22]' (pycatch22 has the licence GPL-3.0)",
    )
    yield FeatureSetEntry(
        name="union",
        target="graspsense.plugins.features.union:UnionFeatures",
        summary="the features of several sets together, by default of chitta, curve and quantiles",
    )
    yield FeatureSetEntry(
        name="contact-image",
        target="graspsense.plugins.features.contact_image:ContactImageFeatures",
        summary="area, centre, axes, total, shift and shear of the contact on a tactile array or a camera",
    )


@hookimpl
def graspsense_sensor_backends() -> Iterable[SensorBackendEntry]:
    """Return the backend that replays a recording."""
    yield SensorBackendEntry(
        name="replay",
        target="graspsense.sources.recordings.replay:ReplayBackend",
        summary="a recording instead of a gripper; a channel it lacks is NaN",
    )


@hookimpl
def graspsense_classifiers() -> Iterable[ClassifierEntry]:
    """Return the classifiers of this package. C4.5, which the paper uses, is in another distribution."""
    for name, target, summary in (
        ("svm", "svm:Svm", "support vector machine (scikit-learn)"),
        ("mlp", "mlp:Mlp", "neural network with one hidden layer (scikit-learn)"),
        ("backprop", "backprop:Backprop", "neural network trained trial by trial, as Weka's by default"),
        ("forest", "forest:Forest", "random forest (scikit-learn)"),
        ("extra-trees", "forest:ExtraTrees", "extremely randomised trees (scikit-learn)"),
        ("boosted", "boosted:Boosted", "gradient-boosted trees (scikit-learn)"),
        ("ebm", "ebm:Ebm", "explainable boosting: a sum of functions of the features (interpret)"),
        ("knn", "knn:Knn", "nearest neighbours (scikit-learn)"),
        ("tree", "tree:Cart", "binary decision tree, CART (scikit-learn)"),
    ):
        yield ClassifierEntry(
            name=name,
            target=f"graspsense.plugins.classifiers.{target}",
            summary=summary,
        )


@hookimpl
def graspsense_datasets() -> Iterable[DatasetEntry]:
    """Return the readers of recorded data."""
    yield DatasetEntry(
        name="icub",
        target="graspsense.sources.recordings.icub_dataset:read_dataset",
        recordings="graspsense.sources.recordings.icub_dataset:read_recordings",
        summary="iCub Grasp Dataset (Soh, Su and Demiris 2012), as icub:FOLDER",
    )
    yield DatasetEntry(
        name="manifest",
        recordings="graspsense.sources.manifest.reader:read_recordings",
        summary="files of other programs that a manifest describes, as manifest:FILE.toml",
    )
    yield DatasetEntry(
        name="store",
        target="graspsense.store.dataset:read_dataset",
        summary="labelled trials of a store, as store:FOLDER",
    )


@hookimpl
def graspsense_pipelines() -> Iterable[PipelineEntry]:
    """Return the pipeline of the paper, and the one that recognises more."""
    yield PipelineEntry(
        name="default",
        resource="graspsense:plugins/pipelines/default.toml",
        summary="simulated gripper, hybrid control, the six features of Table I",
        better="best",
    )
    yield PipelineEntry(
        name="best",
        resource="graspsense:plugins/pipelines/best.toml",
        summary="the default gripper and control, with a neural network on features of the whole force curve",
    )


@hookimpl
def graspsense_experiment_kinds() -> Iterable[ExperimentKindEntry]:
    """Return the kinds of experiments that compare recognition rates, and those of trade-offs."""
    yield ExperimentKindEntry(
        name="recognise",
        run="graspsense.experiments.recognise:recognise",
        keys="graspsense.experiments.recognise:EvaluationSettings",
        seconds_per_trial=0.00986,
        summary="trains and tests classifiers on the trials",
    )
    trades = "graspsense.experiments.trade"
    for name, module, keys, seconds, summary in (
        ("trade", "costs", "TradeSettings", 0.00394, "recognition against what a setting costs"),
        ("early", "early", "EarlySettings", 0.0363, "recognition against the time since contact"),
        ("squeezes", "squeezes", "RepeatSettings", 0.0025, "recognition against the number of squeezes"),
        ("physics", "physics", "ModelErrorSettings", 0.00578, "recognition when test trials lack a term"),
    ):
        yield ExperimentKindEntry(
            name=name,
            run=f"{trades}.{module}:{name}",
            keys=f"{trades}.{module}:{keys}",
            findings=f"{trades}.findings:findings",
            simulates=name != "trade",
            seconds_per_trial=seconds,
            summary=summary,
        )
    yield ExperimentKindEntry(
        name="trades",
        findings=f"{trades}.findings:findings",
        summary="several trade-offs as one experiment",
    )


@hookimpl
def graspsense_experiments() -> Iterable[ExperimentEntry]:
    """Return the experiments of this package; `benchmarks/experiment_times.py` measures the times."""
    for name, seconds in (
        ("probing_force", 0.00986),
        ("trade_accuracy", 0.00626),
        ("trade_cells", 0.0033),
        ("trade_force", 0.009),
        ("trade_frame_rate", 0.00337),
        ("trade_joint", None),
        ("trade_noise", 0.000927),
        ("trade_physics", 0.00529),
        ("trade_recognition", None),
        ("trade_sensing", None),
        ("trade_speed", 0.0045),
        ("trade_squeezes", 0.0025),
        ("trade_time", 0.0363),
        ("which_gripper", 0.326),
    ):
        resource = f"graspsense:experiments/shipped/{name}.toml"
        yield ExperimentEntry(name, resource, seconds_per_trial=seconds)
