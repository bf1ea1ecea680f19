"""Conformance checks of the readers of a distribution, on a folder of sound examples for each of them."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Final, NamedTuple

from graspsense.core.components.registry import Resource
from graspsense.core.values.errors import GraspsenseError
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.replayable import content_sha256
from graspsense.sources.recordings.dataset_recordings import recordings_of
from graspsense.testing.checks import CheckFailed, CheckNotTried, CheckSkipped, demand
from graspsense.testing.subject import Package

MOST_FILES: Final = 4
MOST_COLUMNS: Final = 16
LARGEST_TEXT: Final = 1 << 20


class _Read(NamedTuple):
    """What a reader made of a folder: its recordings as comparable texts, and its errors."""

    recordings: list[str]
    errors: list[str]


def readers_read_the_same_twice(package: Package) -> None:
    """Each reader reads its examples, all of them, and the same again when it reads them once more."""
    for dataset, folder in _examples(package):
        once, again = _read(dataset, folder), _read(dataset, folder)
        demand(
            bool(once.recordings) and not once.errors,
            f"{dataset.name}:{folder} has {len(once.recordings)} readable recordings, and cannot read: "
            f"{'; '.join(once.errors) or 'nothing'}",
        )
        demand(
            once == again,
            f"{dataset.name}:{folder} gives other recordings when it is read again: sort the files, and draw nothing "
            "at random",
        )


def reader_errors_name_file_and_column(package: Package) -> None:
    """What a reader says of an empty file, or of a word in place of a number, names the file and the column."""
    for dataset, folder in _examples(package):
        files = sorted(path for path in folder.rglob("*") if path.is_file())[:MOST_FILES]
        sound = _read(dataset, folder)
        for file in files:
            inside = file.relative_to(folder)
            empty = _read_with(dataset, folder, inside, b"")
            demand(
                bool(empty.errors) or empty == sound,
                f"an empty {inside} is no error, and its recordings are missing: yield an UnreadableRecording for it "
                "(each_readable)",
            )
            for text in empty.errors:
                demand(file.name in text, f"the error of an empty {inside} does not name it: {text}")
            for damaged in _with_a_word(file):
                read = _read_with(dataset, folder, inside, damaged.content)
                demand(
                    bool(read.errors) or read == sound,
                    f"a word in column {damaged.number} ({damaged.name}) of {inside} is no error, and the recordings "
                    "are others",
                )
                for text in read.errors:
                    named = damaged.name in text or re.search(rf"column {damaged.number}\b", text)
                    demand(
                        file.name in text and bool(named),
                        f"the error of a word in column {damaged.number} ({damaged.name}) of {inside} does not name "
                        f"file and column: {text}",
                    )


def _examples(package: Package) -> Iterator[tuple[Resource, Path]]:  # type: ignore[type-arg]
    """Yield each reader with the folder of its examples."""
    readers = [resource for resource in package.resources if getattr(resource.entry, "recordings", "")]
    if not readers:
        raise CheckSkipped("it has no reader of recordings")
    lacking = [reader.name for reader in readers if reader.name not in package.data]
    if lacking:
        raise CheckNotTried(
            f"no examples were given of {', '.join(lacking)} (--data {lacking[0]}=FOLDER, or `data` in a test)"
        )
    for reader in readers:
        folder = Path(package.data[reader.name])
        if not folder.is_dir():
            raise CheckFailed(f"there is no folder {folder} with examples of {reader.name}")
        yield reader, folder


def _read(dataset: Resource, folder: Path) -> _Read:  # type: ignore[type-arg]
    recordings, errors = [], []
    try:
        for recording in recordings_of(dataset, dataset.name, str(folder)):
            if isinstance(recording, UnreadableRecording):
                errors.append(recording.line)
            else:
                recordings.append(_text(recording))
    except GraspsenseError as error:
        errors.append(" ".join(str(error).split()))
    return _Read(recordings, errors)


def _text(recording: LabelledRecording) -> str:
    facts = (
        recording.source,
        recording.label,
        recording.instance,
        recording.recorded_at,
        recording.order,
        dict(recording.values),
        recording.notices,
    )
    return f"{facts} {content_sha256(recording.recording)}"


def _read_with(dataset: Resource, folder: Path, inside: Path, content: bytes) -> _Read:  # type: ignore[type-arg]
    """Read a copy of the folder in which one file has another content."""
    with tempfile.TemporaryDirectory() as scratch:
        # Under the same name, which a reader may take something from.
        copy = Path(scratch) / folder.resolve().name
        shutil.copytree(folder, copy)
        (copy / inside).write_bytes(content)
        return _read(dataset, copy)


class _Damaged(NamedTuple):
    """A text with a word in place of a number: the number and the name of its column."""

    content: bytes
    number: int
    name: str


def _with_a_word(file: Path) -> Iterator[_Damaged]:
    """Yield a table with a word in the middle row, in each of its columns; nothing if the file is no such table."""
    if file.stat().st_size > LARGEST_TEXT:
        return
    try:
        lines = file.read_bytes().decode().splitlines()
    except UnicodeDecodeError:
        return
    rows = [k for k, line in enumerate(lines) if line.strip()]
    if len(rows) < 3:
        return
    k = rows[len(rows) // 2]
    separator = max(",;\t", key=lines[k].count)
    if separator not in lines[k]:
        separator = " "
    head, cells = lines[rows[0]].lstrip("# ").split(separator), lines[k].split(separator)
    for column, cell in enumerate(cells[:MOST_COLUMNS]):
        if re.fullmatch(r"\s*[-+]?[0-9.]+([eE][-+]?[0-9]+)?\s*", cell):
            damaged = [*cells[:column], "word", *cells[column + 1 :]]
            content = "\n".join([*lines[:k], separator.join(damaged), *lines[k + 1 :], ""]).encode()
            name = head[column].strip() if len(head) == len(cells) else f"column {column + 1}"
            yield _Damaged(content, column + 1, name)
