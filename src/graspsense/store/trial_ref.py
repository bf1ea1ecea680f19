"""A trial of a store by name: `DIR#NUMBER`."""

from __future__ import annotations

import tomllib

from graspsense.core.config import NONE
from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.layers import Layer
from graspsense.recording.reader import RecordedGrasp, read_recorded
from graspsense.recording.replayable import Recording
from graspsense.recording.trial_record import beginning_in
from graspsense.store.store import Store


def folder_and_number(name: str) -> tuple[str, int]:
    """Return the folder and the trial's number. Raises ConfigError."""
    folder, mark, number = name.rpartition("#")
    if not mark or not folder or not number.isdecimal() or len(number) > 18:
        raise ConfigError(f"{name!r} names no trial of a store: write DIR#NUMBER, as in trials#12")
    return folder, int(number)


def stored_grasp(name: str) -> RecordedGrasp:
    """Return the recorded grasp of a trial. Raises ConfigError where there is none, DataDamaged."""
    folder, number = folder_and_number(name)
    with Store.read(folder) as store:
        path = store.recording_of(store.listed(number).recording)
    try:
        return read_recorded(path)
    except ConfigError as error:
        raise DataDamaged(f"trial {number} of {folder} has lost its recording: {error}") from error


def stored_recording(name: str) -> Recording:
    """Return the same as what a gripper can replay."""
    return stored_grasp(name).recording()


def own_settings(kind: str, name: str) -> Layer:
    """Return the settings that a recording of ours was made with, but for its gripper, as a layer.

    `kind` is `store` or `mcap`, as in `replay`. Raises ConfigError, DataDamaged.
    """
    grasp = stored_grasp(name) if kind == "store" else read_recorded(name)
    settings = beginning_in(grasp.metadata, str(grasp.path)).settings
    try:
        values = tomllib.loads(settings)
    except (ValueError, RecursionError) as error:
        raise DataDamaged(f"the settings in {grasp.path} are no TOML: {error}") from error
    values = {"classifier": {"type": NONE}, **values}
    return Layer.of({k: v for k, v in values.items() if k != "gripper"}, f"the recording {grasp.path.name}")
