"""The recordings that the sources of `graspsense import` name: a CSV, a manifest, a data set, or a single recording."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from pathlib import Path

from attrs import evolve, frozen

from graspsense.core.values.errors import ConfigError
from graspsense.recording.export_trace import declared_beside
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.readable import each_readable, error_of_all
from graspsense.sources.columns.recording_notices import with_notices
from graspsense.sources.formats.raw_tables import is_text
from graspsense.sources.manifest.alike import compared
from graspsense.sources.recordings.dataset_recordings import (
    datasets_with_recordings,
    is_recording_number,
    numbered_recording,
    readable_or_not,
)
from graspsense.sources.recordings.grasp_csv import named
from graspsense.sources.recordings.replay import KINDS, how_to_get, kind_and_name, known_kinds, read_named
from graspsense.store.labels import labels_of

KIND_OF = {".npz": "npz", ".parquet": "parquet", ".mcap": "mcap", ".bag": "rosbag"}
"""The kind of a file whose name has no kind before it, by its ending."""


@frozen(kw_only=True, eq=False)
class ImportedRecording:
    """A recording to import: its name for `gripper.recording`, and what is known of it."""

    name: str
    labelled: LabelledRecording


def is_csv(source: str) -> bool:
    """Return whether a source is a text file whose columns options name."""
    return ":" not in source and is_text(Path(os.path.expanduser(source)))


def is_plain_file(source: str) -> bool:
    """Return whether a source is a file of samples, or a bag, of another program."""
    path = Path(os.path.expanduser(source))
    if os.path.isdir(path):
        return os.path.isfile(path / "metadata.yaml")
    return os.path.isfile(path) and path.suffix.lower() != ".toml" and not declared_beside(path).exists()


def recordings_to_import(
    sources: Sequence[str], columns: Mapping[str, Sequence[str]], label: str | None
) -> tuple[list[ImportedRecording], list[UnreadableRecording]]:
    """Return the recordings that these sources name, and those that cannot be read.

    `columns` are those of a CSV, `label` is that of all recordings. Raises the first error if none can be read.
    """
    good: list[ImportedRecording] = []
    bad: list[UnreadableRecording] = []
    for source in sources:
        for recording in each_readable(source, partial(_named_by, source, columns, label)):
            if isinstance(recording, UnreadableRecording):
                bad.append(recording)
            else:
                good.append(recording)
    if bad and not good:
        raise error_of_all(bad)
    told = compared([recording.labelled for recording in good], of_file=False)
    return [evolve(each, labelled=labelled) for each, labelled in zip(good, told, strict=True)], bad


def _named_by(
    source: str, columns: Mapping[str, Sequence[str]], label: str | None
) -> Iterator[ImportedRecording | UnreadableRecording]:
    """Yield every recording that a source names. Raises ConfigError, DataDamaged."""
    dataset = _dataset(source)
    if dataset is not None:
        kind, place = dataset
        for number, labelled in enumerate(readable_or_not(kind, place), 1):
            if isinstance(labelled, UnreadableRecording):
                yield labelled
            else:
                name = f"{kind}:{place}#{number}"
                yield from each_readable(labelled.source, partial(_imported, name, labelled, label))
        return
    ending = Path(source).suffix.lower()
    name = f"csv:{named(source, columns)}" if is_csv(source) else source
    if ":" not in source and ending in KIND_OF:
        name = f"{KIND_OF[ending]}:{source}"
    kind, file = kind_and_name(name)
    if is_recording_number(kind, file):
        yield from _imported(name, numbered_recording(kind, file), label)
        return
    if kind not in KINDS:
        kinds = ", ".join(f"{known}:" for known in known_kinds())
        nor_file = "" if os.path.exists(source) else ", nor is there a file of this name"
        folder = f". Of a folder, graspsense import {source} --suggest FILE.toml writes a manifest"
        raise ConfigError(
            f"{source!r} is not a source of recordings{nor_file}: name a FILE.csv, {', '.join(KIND_OF)}, a "
            f"manifest FILE.toml, or write one of {kinds} before a file{how_to_get(kind)}"
            f"{folder if Path(source).is_dir() else ''}"
        )
    recording = with_notices(LabelledRecording(recording=read_named(kind, file), source=source))
    yield from _imported(name, recording, label)


def _dataset(source: str) -> tuple[str, str] | None:
    """Return the data set and the place of all its recordings that a source names, None if it names one recording."""
    if source.lower().endswith(".toml") and ":" not in source:
        return "manifest", source
    kind, _, place = source.partition(":")
    if not place or kind not in datasets_with_recordings() or is_recording_number(kind, place):
        return None
    return (kind, place) if kind not in KINDS or Path(os.path.expanduser(place)).is_dir() else None


def _imported(name: str, labelled: LabelledRecording, label: str | None) -> tuple[ImportedRecording]:
    """Return a recording with the label that a user gave for all. Raises ConfigError if it, or its own, is none."""
    given = labels_of(label or labelled.label) if label is not None or labelled.label else {}
    if label is not None:
        instance = given.get("instance", "").partition("#")[2]
        labelled = evolve(labelled, label=given["label"], instance=instance)
    return (ImportedRecording(name=name, labelled=labelled),)
