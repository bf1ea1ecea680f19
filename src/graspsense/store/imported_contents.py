"""Which contents a store has imported: the same grasp twice would be in training and test data at once."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Final

from graspsense.core.files.whole_file import locked
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import content_sha256
from graspsense.store.recover import Recovered, recover_store
from graspsense.store.store import Store

CONTENT: Final = "content_sha256"
"""Key of the provenance of an imported trial: the hash of its frames, by `content_sha256`."""


class AlreadyImported(ConfigError):
    """The store has this grasp already."""


class ImportedContents:
    """The contents of the imported trials of a store that are complete and not set aside."""

    def __init__(self, store: Store) -> None:
        self._folder = store.folder
        self._trials: dict[str, int] = {}
        self._sources: dict[str, int] = {}
        for number, sha256, source in _imported(store, "set_aside IS NULL AND complete = 1"):
            if source is not None:
                self._sources.setdefault(source, number)
            if sha256 is not None:
                self.add(sha256, number)

    def refuse(self, sha256: str, source: str) -> None:
        """Raise AlreadyImported if the store has this content already; `source` names what is imported."""
        number = self._trials.get(sha256)
        if number is not None:
            raise AlreadyImported(
                f"{source} has the same content as trial {number} of the store in {self._folder}. A grasp that is "
                "stored twice is in training and test data at once, which makes every rate too high. To use it "
                "instead, as with other options, first set that trial aside: graspsense trials aside "
                f"{self._folder}#{number}"
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
def imported_alone(
    store: Store, waiting: Callable[[], None], told: Callable[[Sequence[Recovered]], None]
) -> Iterator[ImportedContents]:
    """Yield the contents of a store while no other import writes to it; `waiting` is called if another one does.

    What a killed import left is completed first, so that it is not imported again; `told` gets what became of it.
    """
    folder = os.open(store.recordings, os.O_RDONLY)
    try:
        if locked(folder) is False:
            waiting()
            locked(folder, waits=True)
        told(recover_store(store))
        yield ImportedContents(store)
    finally:
        os.close(folder)


def refuse_restored(store: Store, numbers: Sequence[int]) -> None:
    """Raise AlreadyImported if one of these trials, which are set aside, was imported again in the meantime."""
    contents = ImportedContents(store)
    for number, sha256, _ in _imported(store, f"id IN ({', '.join(map(str, numbers))})"):
        if sha256 is not None:
            contents.refuse(sha256, f"trial {number}")


def _imported(store: Store, where: str) -> Iterator[tuple[int, str | None, str | None]]:
    """Yield number, content and source of the imported trials that an SQL condition selects.

    A trial of an earlier version has no hash in its provenance; its recording is read.
    """
    columns = store.columns(("id", "recording", "provenance"), f"origin = 'import' AND {where}")
    for number, recording, provenance in zip(*columns.values(), strict=True):
        sha256 = _stated(provenance, CONTENT)
        if sha256 is None:
            with suppress(ConfigError, DataDamaged):  # `graspsense verify` reports it
                sha256 = content_sha256(read_recorded(store.recording_path(recording)).recording())
        yield number, sha256, _stated(provenance, "source")


def _stated(provenance: str, key: str) -> str | None:
    try:
        stated = json.loads(provenance).get(key)
    except (ValueError, AttributeError):
        return None
    return stated if isinstance(stated, str) else None
