"""The grasps of a store: one by its reference `DIR#NUMBER`, as users write it, or all of them to be exported."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from attrs import frozen

from graspsense.core.settings.layers import Layer
from graspsense.core.settings.resolved import NONE, without_followers
from graspsense.core.values.channel import Channel
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.core.values.trace import Trace
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorded_grasp import RecordedGrasp
from graspsense.recording.replayable import Recording
from graspsense.store.opening import place_and_number, store_folder
from graspsense.store.store import Store


@frozen(kw_only=True)
class StoredGrasp:
    """A trial of a store: what is known of it, and its trace, which is read when it is asked for.

    `label` and `instance` are empty where they are not known. `features` has the value of each feature (None if it is
    missing), `units` their units, and those of the channels are those of the trace. `prediction` and `events` are as
    `graspsense run --json` prints them. `source` is the recording that was imported, and empty for other trials.
    """

    number: int
    label: str
    instance: str
    outcome: str
    source: str
    device: str
    simulated: bool
    features: Mapping[str, float | None]
    units: Mapping[str, str]
    prediction: Mapping[str, Any] | None
    events: tuple[Mapping[str, Any], ...]
    channels: tuple[Channel, ...]
    recording: Path
    recording_sha256: str

    def trace(self) -> Trace:
        """Return the trace of the whole recording. Raises ConfigError, DataDamaged."""
        return read_recorded(self.recording, sha256=self.recording_sha256).trace()


def stored_grasps(folder: str | Path) -> tuple[StoredGrasp, ...]:
    """Return the complete trials of a store that are not set aside, oldest first.

    Raises ConfigError if there is none, DataDamaged.
    """
    with Store.read(folder) as store:
        numbers = store.query("SELECT id FROM trial WHERE set_aside IS NULL AND complete = 1 ORDER BY id")
        if not numbers:
            raise ConfigError(f"the store in {folder} has no complete trial to export")
        return tuple(_grasp(store, number) for (number,) in numbers)


def _grasp(store: Store, number: int) -> StoredGrasp:
    trial = store.trial(number)
    result, device = trial.result, trial.record.device
    details = result.details
    return StoredGrasp(
        number=number,
        label=trial.summary.label or "",
        instance=trial.summary.instance or "",
        outcome=result.outcome,
        source=str(trial.record.settings.get("gripper", {}).get("recording", "")),
        device=trial.summary.device,
        simulated=trial.summary.simulated,
        features=result.features.as_dict(),
        units=dict(zip(result.features.names, result.features.units, strict=True)),
        prediction=details.get("prediction"),
        events=tuple(details.get("events") or ()),
        channels=device.channels if device else (),
        recording=trial.recording,
        recording_sha256=trial.recording_sha256,
    )


def parse_trial_ref(text: str) -> tuple[str, int]:
    """Return the folder of the store and the number of the trial. Raises ConfigError."""
    folder, number = place_and_number(text)
    if number is None:
        raise ConfigError(f"{text!r} is not a trial of a store: write DIR#NUMBER, as in trials#12")
    return store_folder(folder), number


def stored_grasp(ref: str) -> RecordedGrasp:
    """Return the recorded grasp of a trial.

    Raises ConfigError if there is no such trial, DataDamaged if its recording is lost or damaged.
    """
    folder, number = parse_trial_ref(ref)
    with Store.read(folder) as store:
        path = store.recording_path(store.summary(number).recording)
        ((sha256,),) = store.query("SELECT recording_sha256 FROM trial WHERE id = ?", (number,))
    try:
        return read_recorded(path, sha256=sha256)
    except ConfigError as error:
        if path.exists():
            raise
        raise DataDamaged(f"the recording of trial {number} of {folder} is lost: {error}") from error


def stored_recording(ref: str) -> Recording:
    """Return the recorded grasp of a trial in the form that a gripper can replay."""
    return stored_grasp(ref).recording()


def recorded_settings(kind: str, name: str) -> Layer:
    """Return the settings of a recorded grasp, except those of its gripper, as a layer of settings.

    `kind` is `store` or `mcap`, as in the setting `gripper.recording` of `replay`. Raises ConfigError, DataDamaged.
    """
    grasp = stored_grasp(name) if kind == "store" else read_recorded(name)
    values = {"classifier": {"type": NONE}, **without_followers(grasp.record().settings)}
    return Layer(
        label=f"the recording {grasp.path.name}", values={k: v for k, v in values.items() if k != "gripper"}
    )
