"""Verifying stored data: the hash of every row and recording, and the checksums in every file."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

from attrs import asdict, frozen

from graspsense.core.values.errors import DataDamaged, GraspsenseError
from graspsense.recording.layout import PART
from graspsense.recording.reader import read_recorded
from graspsense.store.changes import inconsistencies
from graspsense.store.opening import FILE
from graspsense.store.recover import CUT, is_being_written
from graspsense.store.store import Store, integrity, stored_rows

Progress = Callable[[int, int], None]


@frozen(kw_only=True)
class Verified:
    """What was checked, the problems found, and the files that `graspsense recover` can complete."""

    trials: int
    recordings: int
    problems: tuple[str, ...]
    unread: tuple[str, ...] = ()
    """What the machine could not read, so that nothing is known of it."""
    unfinished: tuple[str, ...]

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        return {"intact": not self.problems and not self.unread, **asdict(self)}


def verify_store(folder: str | Path, progress: Progress | None = None) -> Verified:
    """Check a store: SQLite's own checks, the hash of every row, and the hash of every recording.

    Raises ConfigError if there is no store, DataDamaged if it cannot be opened.
    """
    with Store.read(folder) as store:
        problems = [f"the database: {problem}" for problem in integrity(store)]
        unread = []
        rows = list(stored_rows(store))
        names, changed = set(), set()
        for done, (number, sha256, row) in enumerate(rows):
            if progress is not None:
                progress(done, len(rows))
            if sha256 != row.sha256:
                problems.append(f"trial {number}: its row was changed after it was written")
                changed.add(number)
            try:
                path = store.recording_path(str(row.trial["recording"]))
            except DataDamaged as error:
                problems.append(f"trial {number}: {error}")
                continue
            names.add(path.name)
            try:
                problem = _problem_of(path, str(row.trial["recording_sha256"]), row.trial["recording_bytes"])
            except OSError as error:
                unread.append(f"trial {number}: its recording {path.name}: {error.strerror}")
                continue
            if problem:
                problems.append(f"trial {number}: {problem}")
        problems += [
            f"trial {number}: {problem}"
            for number, problem in inconsistencies(store).items()
            if number not in changed
        ]
        unfinished = []
        for path in sorted(store.recordings.iterdir() if store.recordings.is_dir() else ()):
            if not path.is_file():
                unfinished.append(f"{path.name} is not a file")
            elif path.name.endswith(PART):
                if not is_being_written(path):
                    unfinished.append(f"{path.name} was never finished")
            elif path.suffix == ".mcap" and path.name not in names:
                unfinished.append(f"{path.name} has no row")
            elif not path.name.endswith((".mcap", CUT)):
                unfinished.append(f"{path.name} is not a recording of the store")
    return Verified(
        trials=len(rows),
        recordings=len(names),
        problems=tuple(problems),
        unread=tuple(unread),
        unfinished=tuple(unfinished),
    )


def verify_file(path: str | Path) -> Verified:
    """Check the checksums, the end and the message numbers of a recording. Raises ConfigError, DataDamaged.

    For the database of a store, check the store.
    """
    if Path(path).name == FILE:
        return verify_store(Path(path).parent)
    read_recorded(path)
    return Verified(trials=0, recordings=1, problems=(), unfinished=())


def _problem_of(path: Path, sha256: str, size: int) -> str:
    """Return what is wrong with a recording, empty if nothing is. Raises OSError if the machine cannot read it."""
    if path.exists() and not path.is_file():
        return f"its recording {path.name} is not a file"
    try:
        with path.open("rb") as file:
            if hashlib.file_digest(file, "sha256").hexdigest() == sha256:
                return ""
        st_size = path.stat().st_size
    except FileNotFoundError:
        return f"its recording {path.name} is missing"
    if st_size != size:
        return f"its recording {path.name} has {st_size} bytes and had {size}"
    try:
        read_recorded(path)
    except GraspsenseError as error:
        return str(error)
    return f"its recording {path.name} was changed after it was written"
