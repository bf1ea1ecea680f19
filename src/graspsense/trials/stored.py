"""A trial of a store by name: `DIR#NUMBER`."""

from __future__ import annotations

from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.trials.recorded import RecordedGrasp, read_recorded
from graspsense.trials.recording import Recording
from graspsense.trials.store import Store


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
