"""Which contents a store has imported: the same grasp twice would be in training and test data at once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Final

from graspsense.core.files.whole_file import locked
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import content_sha256
from graspsense.store.store import Store

CONTENT: Final = "content_sha256"
"""Key of the provenance of an imported trial: the hash of its frames, by `content_sha256`."""


class AlreadyImported(ConfigError):
    """The store has this grasp already."""


class ImportedContents:
    """The contents of the imported trials of a store that are complete and not set aside.

    A trial of an earlier version has no hash in its provenance; its recording is read.
    """

    def __init__(self, store: Store) -> None:
        self._folder = store.folder
        self._trials: dict[str, int] = {}
        self._sources: dict[str, int] = {}
        imported = "origin = 'import' AND set_aside IS NULL AND complete = 1"
        columns = store.columns(("id", "recording", "provenance"), imported)
        for number, recording, provenance in zip(*columns.values(), strict=True):
            sha256, source = _stated(provenance, CONTENT), _stated(provenance, "source")
            if source is not None:
                self._sources.setdefault(source, number)
            if sha256 is None:
                try:
                    sha256 = content_sha256(read_recorded(store.recording_path(recording)).recording())
                except (ConfigError, DataDamaged):
                    continue  # `graspsense verify` reports it
            self._trials.setdefault(sha256, number)

    def refuse(self, sha256: str, source: str) -> None:
        """Raise AlreadyImported if the store has this content already; `source` names what is imported."""
        number = self._trials.get(sha256)
        if number is not None:
            raise AlreadyImported(
                f"{source} has the same content as trial {number} of the store in {self._folder}. A grasp that is "
                "stored twice is in training and test data at once, which makes every rate too high. To import it "
                f"again with other options, first set that trial aside: graspsense trials aside {self._folder}#{number}"
            )

    def earlier(self, source: str) -> int | None:
        """Return the trial that was imported before from a source of this name, None if there is none.

        It may be the same grasp, read by a manifest that was corrected since.
        """
        return self._sources.get(source)

    def add(self, sha256: str, number: int) -> None:
        """Note the content of a trial that was just imported."""
        self._trials.setdefault(sha256, number)


@contextmanager
def imported_alone(store: Store, waiting: Callable[[], None]) -> Iterator[None]:
    """Let no other import write to a store; `waiting` is called if one has to end first."""
    folder = os.open(store.recordings, os.O_RDONLY)
    try:
        if locked(folder) is False:
            waiting()
            locked(folder, waits=True)
        yield
    finally:
        os.close(folder)


def _stated(provenance: str, key: str) -> str | None:
    try:
        stated = json.loads(provenance).get(key)
    except (ValueError, AttributeError):
        return None
    return stated if isinstance(stated, str) else None
