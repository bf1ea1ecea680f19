"""The recordings of a data set: `NAME:PLACE` names all of them, `NAME:PLACE#NUMBER` the one with this number."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from itertools import islice
from typing import Final

from graspsense.core.components.entries import DatasetEntry
from graspsense.core.components.registry import Resource, installed
from graspsense.core.values.errors import (
    ComponentFailed,
    ConfigError,
    GraspsenseError,
    PluginUnavailable,
    named,
)
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable, is_mistake, readable
from graspsense.recording.replayable import Recording, check_recording
from graspsense.sources.columns.recording_notices import with_notices
from graspsense.store.stored_grasps import stored_grasps

_NUMBERED: Final = re.compile(r"(?P<place>.+)#(?P<number>[1-9]\d{0,8})", re.DOTALL)

_handed: dict[str, Recording] = {}


def datasets_with_recordings() -> tuple[str, ...]:
    """Return the names of the installed data sets that have recordings."""
    return tuple(dataset.name for dataset in installed().resources(DatasetEntry) if dataset.entry.recordings)


def datasets_to_write() -> tuple[str, ...]:
    """Return the names of the installed data sets that trials can be written as."""
    return tuple(dataset.name for dataset in installed().resources(DatasetEntry) if dataset.entry.export)


def write_dataset(kind: str, place: str, store: str) -> dict[str, int]:
    """Write the trials of a store as a data set, and return what was counted. Raises ConfigError, DataDamaged."""
    dataset = installed().resource(DatasetEntry, kind)
    with failing_as(f"data set {dataset.qualified}"):
        return dict(dataset.load("export")(stored_grasps(store), place))


def is_recording_number(kind: str, name: str) -> bool:
    """Return whether this names a recording of a data set by its number."""
    return _NUMBERED.fullmatch(name) is not None and kind in datasets_with_recordings()


def readable_or_not(kind: str, place: str) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every recording of a data set, also those that cannot be read.

    A reader that fails ends its data set: what it failed with comes last. Raises UnknownName, PluginUnavailable, and
    ConfigError or DataDamaged if it fails before the first recording.
    """
    yield from recordings_of(installed().resource(DatasetEntry, kind), kind, place)


def recordings_of(
    dataset: Resource[DatasetEntry], kind: str, place: str
) -> Iterator[LabelledRecording | UnreadableRecording]:
    """Yield every recording of a data set at this place, as `readable_or_not`."""
    read = dataset.recordings()
    number = 0
    try:
        with readable(f"{kind}:{place}"), failing_as(f"data set {dataset.qualified}"):
            for recording in read(place):
                if not isinstance(recording, LabelledRecording | UnreadableRecording):
                    raise PluginUnavailable(
                        f"data set {dataset.qualified} cannot be used here: its reader gave "
                        f"{type(recording).__name__}, not LabelledRecording"
                    )
                number += 1
                if isinstance(recording, UnreadableRecording):
                    yield recording
                else:
                    yield from each_readable(recording.source, partial(_noticed, recording))
    except PluginUnavailable:
        raise
    except GraspsenseError as error:
        if not number:
            raise
        yield UnreadableRecording(source=f"{kind}:{place}, behind recording {number}", error=error)


def _noticed(recording: LabelledRecording) -> tuple[LabelledRecording]:
    """Return the recording with all that looks wrong in it. Raises DataDamaged."""
    check_recording(recording.recording)
    return (with_notices(recording),)


@contextmanager
def failing_as(component: str) -> Iterator[None]:
    """Turn what a component of a plugin raises, beside errors of ours, into an error that names it."""
    try:
        yield
    except (GraspsenseError, MemoryError, OSError):
        raise
    except Exception as error:
        if is_mistake(error):
            raise
        raise ComponentFailed(f"{component} failed: {named(error)}") from error


def numbered_recording(kind: str, name: str) -> LabelledRecording:
    """Return the recording that `PLACE#NUMBER` names. Raises ConfigError if there is none, and as `readable_or_not`."""
    match = _NUMBERED.fullmatch(name)
    if match is None:
        raise ConfigError(
            f"{kind}:{name} names all recordings of a data set: write the number of one behind it, as in "
            f"{kind}:{name}#1"
        )
    number = int(match["number"])
    numbered = next(islice(readable_or_not(kind, match["place"]), number - 1, None), None)
    if isinstance(numbered, UnreadableRecording):
        raise numbered.error
    if numbered is None:
        raise ConfigError(f"{kind}:{match['place']} has fewer than {number} recordings")
    return numbered


def handed_recording(name: str) -> Recording | None:
    """Return the recording that is being imported under this name, None if it is another one."""
    return _handed.get(name)


@contextmanager
def handed_over(name: str, recording: Recording) -> Iterator[None]:
    """While a recording is imported, `handed_recording` returns it under its name, so that its file is read once."""
    _handed[name] = recording
    try:
        yield
    finally:
        del _handed[name]
