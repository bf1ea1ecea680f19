"""A sound part of each role, small enough to be read: what the mutants of `mutants.py` are broken copies of."""

from __future__ import annotations

import math
from math import inf, nan
from typing import NamedTuple

import numpy as np
from attrs import evolve, frozen

from graspsense.classifier_api import in_words
from graspsense.gripper_api import TareRefused
from graspsense.plugin_api import (
    EFFORT,
    NAMES_INPUT,
    NO_PADS,
    Channel,
    Classifier,
    ClassifierConfig,
    ClassifierEntry,
    Command,
    Controller,
    ControllerEntry,
    DeviceInfo,
    DeviceLost,
    FastChannel,
    Feature,
    Features,
    FeatureSet,
    FeatureSetEntry,
    Frame,
    NoDevice,
    ObjectKind,
    Prediction,
    Reading,
    SensorBackend,
    SensorBackendEntry,
    TactileArray,
    hookimpl,
    setting,
)
from graspsense.simulator_api import CompiledFeatures
from graspsense.testing.laws import GentleController as Gentle
from graspsense.testing.laws import GentleParams, GentleState, step
from graspsense.testing.model_gripper import ModelGripper


@frozen(kw_only=True)
class NoKeys:
    pass


@frozen(kw_only=True)
class PeakConfig:
    side: str = setting(default="left", meaning="The pad whose force counts.")


class Peak(FeatureSet[PeakConfig]):
    def extract(self, trace):
        known = trace.force_left_n[~np.isnan(trace.force_left_n)]
        value = float(known.max()) if len(known) else nan
        reasons = {} if len(known) else {"peak": "the left pad gave no number"}
        return Features(names=("peak",), values=(value,), units=("N",), reasons=reasons)


class Shaking(FeatureSet[PeakConfig]):
    """Reads nothing but a fast channel."""

    def extract(self, trace):
        values = trace.signals["acceleration"].values
        known = values[~np.isnan(values)]
        reasons = {} if len(known) else {"shaking": "no sample has a number"}
        value = float(np.abs(known).max()) if len(known) else nan
        return Features(names=("shaking",), values=(value,), units=("m/s2",), reasons=reasons)


class Extremes(NamedTuple):
    peak_n: float
    ticks: float


def measure_extremes(params, ticks):
    peak = -math.inf
    n = 0
    for force in ticks.force_left_n:
        if not math.isnan(force):
            peak = max(peak, force)
            n += 1
    return Extremes(peak, float(n))


def features_of_extremes(feature_set, measured, units):
    reasons = {} if measured.ticks else {"peak": "the left pad gave no number"}
    return Features(
        names=("peak",), values=(measured.peak_n if measured.ticks else nan,), units=("N",), reasons=reasons
    )


class NamedPeak(Peak):
    """Is compiled with a named tuple."""

    compiled = CompiledFeatures(measure_extremes, lambda feature_set: (), features_of_extremes)


@frozen(kw_only=True)
class LawConfig:
    speed_m_s: float = setting(default=0.01, unit="m/s", above=0.0, meaning="Closing speed.")


class Law(Controller[LawConfig]):
    step = staticmethod(step)

    def params(self):
        return GentleParams(EFFORT)

    def init(self):
        return Gentle(EFFORT).init()


@frozen(kw_only=True)
class HandConfig:
    vanishes_s: float = setting(default=inf, unit="s", meaning="When the cable is pulled.")
    object: str = setting(default="cup:full", effect=NAMES_INPUT, meaning="What it holds.")
    here: bool = setting(default=True, meaning="Whether the gripper is connected.")


class Hand(SensorBackend[HandConfig]):
    """The model_gripper with cells, a zero, and a cable."""

    _bench = None

    def objects(self):
        return (ObjectKind(name="cup", states=("full", "empty")),)

    def with_object(self, name):
        return type(self)(evolve(self.config, object=name))

    def open(self, seed):
        if not self.config.here:
            raise NoDevice("no hand at port 7: plug it in, then `graspsense devices`")
        self._bench, self._zero = (
            ModelGripper(frozenset((*CHANNELS_OF_HAND, ACCELERATION, CAMERA)), 0.065, 1500.0),
            None,
        )
        self._info = self._bench.open(seed)
        self._effort = 0.0
        return DeviceInfo(
            name="hand",
            clock="virtual",
            simulated=True,
            rate_hz=1000.0,
            effort_limit_n=100.0,
            speed_limit_m_s=0.2,
            opening=Command(EFFORT, -15.0, inf, inf),
            relaxed=Command(EFFORT, 0.0, inf, inf),
            tare_images=2,
        )

    def read(self, timeout_s):
        frame, pads, signals = self._opened().read(timeout_s)
        if frame.t_s > self.config.vanishes_s:
            raise DeviceLost("the hand at port 7 does not answer: look at its cable")
        if self._zero is None:
            frame = frame._replace(
                force_left_n=frame.force_left_n + 2.0, force_right_n=frame.force_right_n + 2.0
            )
        return Reading(frame, pads, signals)

    def apply(self, command):
        self._opened().apply(command)

    def tare(self, images):
        if len(images) < 2:
            raise TareRefused("two images are needed")
        self._zero = images[-1]

    def close(self):
        self._bench = None

    def report(self):
        return {"hands": 1}

    def dry_run_backend(self):
        return type(self)(HandConfig())

    def _opened(self):
        if self._bench is None:
            raise DeviceLost("the hand is not open")
        return self._bench


ACCELERATION = FastChannel("acceleration", "m/s2", 3000.0, samples=3, axes=("x", "y", "z"))
CAMERA = TactileArray("camera", "counts", rows=2, columns=2, dtype="uint8")
CHANNELS_OF_HAND = (
    *("gap", "velocity", "effort", "force_left", "force_right", "edge_left", "edge_right", "pads"),
)


class Nearest(Classifier[ClassifierConfig]):
    """The label of the nearest mean, in standard deviations."""

    _model = None

    def fit(self, table, labels, seed):
        if len(set(labels)) < 2:
            raise ValueError("one label only: there is nothing to tell apart")
        values = table.values
        counts = np.maximum((~np.isnan(values)).sum(axis=0), 1)
        mean = np.nansum(values, axis=0) / counts
        scale = np.sqrt(np.nansum((values - mean) ** 2, axis=0) / counts) + 1e-12
        known = sorted(set(labels))
        which = np.array([known.index(label) for label in labels])
        scaled = np.nan_to_num((values - mean) / scale)
        centres = np.array([scaled[which == i].mean(axis=0) for i in range(len(known))])
        self._model = {
            "features": list(table.names),
            "classes": known,
            "mean": mean.tolist(),
            "scale": scale.tolist(),
            "centres": centres.tolist(),
        }

    def classes(self):
        return tuple(self._model["classes"])

    def probabilities(self, table):
        model = self._model
        values = table.columns(model["features"]).values
        scaled = np.nan_to_num((values - np.array(model["mean"])) / np.array(model["scale"]))
        apart = ((scaled[:, None, :] - np.array(model["centres"])[None]) ** 2).sum(axis=2)
        weight = np.exp(-0.5 * (apart - apart.min(axis=1, keepdims=True)))
        return weight / weight.sum(axis=1, keepdims=True)

    def explain(self, features):
        from graspsense.classifier_api import table_of

        shares = self.probabilities(table_of([features]))[0].tolist()
        name, value, unit = features.names[0], features.values[0], features.units[0]
        said = "missing" if math.isnan(value) else in_words(value, unit)
        return Prediction(
            label=self.classes()[int(np.argmax(shares))],
            probabilities=dict(zip(self.classes(), shares, strict=True)),
            because=(f"{name} is {said}",),
        )

    def to_json(self):
        return self._model

    def from_json(self, model):
        if len(model["centres"]) != len(model["classes"]):
            raise ValueError("as many centres as classes are needed")
        self._model = {key: model[key] for key in ("features", "classes", "mean", "scale", "centres")}


def channels(*names, rate_hz=1000.0):
    from graspsense.simulator_api import CHANNELS

    return tuple(
        TactileArray(name, "counts", rate_hz, rows=2, columns=11)
        if name == "pads"
        else Channel(name, CHANNELS[name], rate_hz)
        for name in names
    )


ENTRIES = {
    "feature-set": FeatureSetEntry(
        name="peak",
        target="parts:Peak",
        config="parts:PeakConfig",
        summary="greatest force of the left pad",
        requires=(Channel("force_left", "N"),),
        features=(Feature("peak", "N", "largest force of the left pad"),),
    ),
    "controller": ControllerEntry(
        name="gentle",
        target="parts:Law",
        config="parts:LawConfig",
        summary="closes gently",
        requires=(Channel("gap", "m"), Channel("velocity", "m/s")),
        commands=("effort",),
    ),
    "sensor-backend": SensorBackendEntry(
        name="hand",
        target="parts:Hand",
        config="parts:HandConfig",
        summary="a hand that is a mass and a spring",
        channels=(*channels(*CHANNELS_OF_HAND), ACCELERATION, CAMERA),
        accepts=("effort",),
    ),
    "classifier": ClassifierEntry(
        name="nearest",
        target="parts:Nearest",
        config="graspsense.plugin_api:ClassifierConfig",
        summary="the nearest mean",
    ),
}
HOOKS = {
    "graspsense_sensor_backends": SensorBackendEntry,
    "graspsense_controllers": ControllerEntry,
    "graspsense_feature_sets": FeatureSetEntry,
}


def offering(*entries):
    """Return a plugin that offers these components."""

    def of_kind(kind):
        return hookimpl(lambda self: [entry for entry in entries if isinstance(entry, kind)])

    hooks = {hook: of_kind(kind) for hook, kind in HOOKS.items()}
    return type("Plugin", (), {"GRASPSENSE_API": (2, 0), **hooks})()


def implementing(hook, implementation, **options):
    """Return a plugin that implements this hook by this function."""
    return type("Plugin", (), {"GRASPSENSE_API": (2, 0), hook: hookimpl(implementation, **options)})()


HAND_LOST = {"vanishes_s": 0.3}
HAND_ABSENT = {"here": False}

__all__ = ["ENTRIES", "NO_PADS", "Frame", "GentleState", "Hand", "Law", "Nearest", "NoKeys", "Peak"]
