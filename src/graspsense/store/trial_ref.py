"""References to trials of a store, as users write them: `DIR#NUMBER`."""

from __future__ import annotations

from graspsense.core.settings.layers import Layer
from graspsense.core.settings.resolved import NONE, without_followers
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.recording.reader import read_recorded
from graspsense.recording.recorded_grasp import RecordedGrasp
from graspsense.recording.replayable import Recording
from graspsense.store.naming import store_folder
from graspsense.store.store import Store


def parse_trial_ref(text: str) -> tuple[str, int]:
    """Return the folder of the store and the number of the trial. Raises ConfigError."""
    folder, mark, number = text.rpartition("#")
    if not mark or not folder or not number.isdecimal() or len(number) > 18:
        raise ConfigError(f"{text!r} is not a trial of a store: write DIR#NUMBER, as in trials#12")
    return store_folder(folder), int(number)


def stored_grasp(ref: str) -> RecordedGrasp:
    """Return the recorded grasp of a trial.

    Raises ConfigError if there is no such trial, DataDamaged if its recording is lost or damaged.
    """
    folder, number = parse_trial_ref(ref)
    with Store.read(folder) as store:
        path = store.recording_path(store.summary(number).recording)
    try:
        return read_recorded(path)
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
    return Layer.without_file(
        {k: v for k, v in values.items() if k != "gripper"}, f"the recording {grasp.path.name}"
    )
