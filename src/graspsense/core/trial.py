"""What a grasp leaves behind: the trial, with everything that made it, and the events on the way."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from attrs import field, frozen

from graspsense.core.signals import Outcome, Phase

if TYPE_CHECKING:
    from graspsense.core.features import Features, Prediction
    from graspsense.core.roles import DeviceInfo
    from graspsense.core.trace import Trace


@frozen(kw_only=True)
class RunInfo:
    """What is about to run: qualified names and versions of the components, the resolved settings, the seed."""

    components: Mapping[str, str]
    settings: Mapping[str, Any]
    seed: int
    labels: Mapping[str, str] = field(factory=dict)


@frozen
class GraspEvent:
    """Something that happened once: at `t_s`, in `phase`, in a sentence."""

    t_s: float
    phase: Phase
    what: str


@frozen(kw_only=True, eq=False)
class Trial:
    """One grasp: trace, features, prediction, labels, and every setting, version and seed that made it.

    `reason` says why where the outcome alone does not. `device` describes the gripper as it was opened;
    `report` is what the gripper counted or, being simulated, knows to be true. `counts` are the runner's own:
    ticks, late frames, how often the guard acted.
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


def trial_as_json(trial: Trial) -> dict[str, Any]:
    """Return what `graspsense run --json` prints: everything but the trace, a missing feature as None."""
    features, prediction, device = trial.features, trial.prediction, trial.device
    return {
        "outcome": trial.outcome.words,
        "reason": trial.reason,
        "features": features.as_dict(),
        "units": dict(zip(features.names, features.units, strict=True)),
        "reasons": dict(features.reasons),
        "prediction": None
        if prediction is None
        else {
            "label": prediction.label,
            "probabilities": dict(prediction.probabilities),
            "because": list(prediction.because),
            "warnings": list(prediction.warnings),
            "model": prediction.model,
        },
        "components": dict(trial.run.components),
        "seed": trial.run.seed,
        "labels": dict(trial.run.labels),
        "device": {
            "name": device.name,
            "serial": device.serial,
            "firmware": device.firmware,
            "clock": device.clock,
            "rate_hz": device.rate_hz,
            "calibration": dict(device.calibration),
            "notes": list(device.notes),
        },
        "report": dict(trial.report),
        "counts": dict(trial.counts),
        "events": [
            {"t_s": event.t_s, "phase": event.phase.name.lower(), "what": event.what}
            for event in trial.events
        ],
        "seconds_simulated": trial.seconds_simulated,
        "seconds_wall": trial.seconds_wall,
    }
