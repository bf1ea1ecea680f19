"""The result of a grasp: the trial, with the settings that made it, and its events."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from typing import TYPE_CHECKING, Any, Final

from attrs import field, frozen

from graspsense.core.values.display import html
from graspsense.core.values.errors import UnknownName
from graspsense.core.values.printable import in_one_line
from graspsense.core.values.signals import GraspEvent, Outcome, event_as_json

if TYPE_CHECKING:
    from graspsense.core.values.device import DeviceInfo
    from graspsense.core.values.features import CheckpointPrediction, Features, Prediction
    from graspsense.core.values.trace import Trace


@frozen(kw_only=True)
class RunInfo:
    """A grasp before it starts: names and versions of the components, the resolved settings, the seed."""

    components: Mapping[str, str]
    settings: Mapping[str, Any]
    seed: int
    labels: Mapping[str, str] = field(factory=dict)


@frozen(kw_only=True, eq=False)
class Trial:
    """One grasp: trace, features, prediction, labels, and every setting, version and seed that made it.

    `reason` explains the outcome if this is needed. `device` describes the gripper as it was opened. `report` holds
    the counters of the gripper, and the true values if it is simulated. `counts` are those of the runner: ticks, late
    frames, actions of the guard. `checkpoints` are the predictions while the grasp went on. With the outcome
    `recognised`, the last of them ended the squeeze: it is the prediction, and its features are those of the trial.
    `warnings` are faults of pads, motor and connection that were seen in the grasp, each in a sentence.
    """

    run: RunInfo
    trace: Trace
    outcome: Outcome
    reason: str
    features: Features
    prediction: Prediction | None
    device: DeviceInfo
    report: Mapping[str, Any]
    counts: Mapping[str, int]
    events: tuple[GraspEvent, ...]
    seconds_simulated: float | None
    seconds_wall: float
    checkpoints: tuple[CheckpointPrediction, ...] = ()
    warnings: tuple[str, ...] = ()

    def __repr__(self) -> str:
        parts = [self.outcome.words, *self.run.labels.values(), f"{len(self.trace)} ticks"]
        if self.prediction is not None:
            parts.append(f"predicted {self.prediction.label}")
        return in_one_line(f"<Trial: {', '.join(parts)}>")

    def _repr_html_(self) -> str:
        return html(self)

    def apart_s(self, channel: str, other: str) -> float:
        """Return by how much (s) the times of two channels can be apart at most; inf where the gripper does not tell.

        Channels of one device are measured together. Raises UnknownName for a channel that the gripper does not have.
        """
        known = tuple(declared.name for declared in self.device.channels)
        for name in (channel, other):
            if name not in known:
                raise UnknownName(f"no channel {name!r}: the gripper has {', '.join(known)}")
        return apart_s(self.trace, self.report, channel, other)


def trial_as_json(trial: Trial) -> dict[str, Any]:
    """Return the trial without its trace as `graspsense run --json` prints it; a missing feature is None."""
    features, prediction, device = trial.features, trial.prediction, trial.device
    return {
        "outcome": trial.outcome.words,
        "reason": trial.reason,
        "warnings": list(trial.warnings),
        "features": features.as_dict(),
        "units": dict(zip(features.names, features.units, strict=True)),
        "reasons": dict(features.reasons),
        "prediction": None if prediction is None else _prediction_as_json(prediction),
        "checkpoints": [
            {
                "after_s": checkpoint.after_s,
                "t_s": checkpoint.t_s,
                **_prediction_as_json(checkpoint.prediction),
            }
            for checkpoint in trial.checkpoints
        ],
        "components": dict(trial.run.components),
        "seed": trial.run.seed,
        "labels": dict(trial.run.labels),
        "device": {
            **{name: getattr(device, name) for name in ("name", "serial", "firmware", "clock", "rate_hz")},
            "calibration": dict(device.calibration),
            "notes": list(device.notes),
            "mounting": {name: mounting.as_json() for name, mounting in device.mounting.items()},
        },
        "report": dict(trial.report),
        "counts": dict(trial.counts),
        "events": [event_as_json(event) for event in trial.events],
        "seconds_simulated": trial.seconds_simulated,
        "seconds_wall": trial.seconds_wall,
    }


def _prediction_as_json(prediction: Prediction) -> dict[str, Any]:
    return {**prediction.as_json(), "warnings": list(prediction.warnings), "model": prediction.model}


FRAME: Final = "frame"
"""The source of every channel that no other one names."""
CHANNELS_OF: Final = "_channels"
OF_IMAGES: Final = ("force_left", "force_right", "edge_left", "edge_right")
"""Channels of the frame that can come from the last image, which is older than the frame."""


def apart_s(trace: Trace, report: Mapping[str, Any], channel: str, other: str) -> float:
    """Return by how much (s) the times of these channels can be apart at most; inf where the gripper does not tell.

    A source that `report` names by `NAME_channels` has its `NAME_uncertainty_s`. A number that comes from an image has
    the time of its frame, and is as old as the image. The shortest delay of a device cannot be told from an offset of
    its clock, and is not in it.
    """
    sources = [_source(report, name) for name in (channel, other)]
    ages_s = [_age_s(trace, name) for name in (channel, other)]
    if sources[0] == sources[1]:
        return 0.0 if ages_s[0] == ages_s[1] else max(ages_s)
    return sum(float(report.get(f"{source}_uncertainty_s", inf)) for source in sources) + sum(ages_s)


def _source(report: Mapping[str, Any], channel: str) -> str:
    for key, channels in report.items():
        if key.endswith(CHANNELS_OF) and channel in str(channels).split():
            return key.removesuffix(CHANNELS_OF)
    return FRAME


def _age_s(trace: Trace, channel: str) -> float:
    """Return how old the image of this number is at most in a frame; 0 for what is measured with the frame.

    A number that does not change more often than there are images comes from them.
    """
    if channel not in OF_IMAGES or not len(trace.pad_t_s):
        return 0.0
    values = getattr(trace, f"{channel}_n")
    if int((values[1:] != values[:-1]).sum()) > len(trace.pad_t_s):
        return 0.0
    ages = [
        float(end_s - begin_s)
        for begin_s, end_s in zip(trace.pad_t_s, [*trace.pad_t_s[1:], trace.t_s[-1]], strict=True)
    ]
    return max(0.0, *ages)
