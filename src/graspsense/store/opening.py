"""Opening the SQLite file of a store: how a user names it, version checks before anything is touched, and errors that a
user can act on."""

from __future__ import annotations

import json
import os
import re
import shutil
import sqlite3
import tempfile
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Final
from urllib.parse import quote

from graspsense import __version__
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.store.schema import APPLICATION_ID, NEWEST, tables_in, tables_of_version

FILE: Final = "store.sqlite"
RECORDINGS: Final = "recordings"
BUSY_S: Final = 30.0
"""How long a connection waits for the lock of another program."""

_MAGIC: Final = b"SQLite format 3\0"
_HEADER_BYTES: Final = 100
_REPAIR: Final = (
    "`graspsense verify {folder}` lists what is intact. The recordings hold everything: move "
    + FILE
    + " away, and `graspsense recover {folder}` builds a new one from them"
)


def damaged(folder: Path, problem: str) -> DataDamaged:
    """Return the error for a damaged store, with advice on its repair."""
    return DataDamaged(f"the store in {folder} is damaged: {problem}. {_REPAIR.format(folder=folder)}")


def decoded(folder: str | Path, text: str) -> dict[str, str]:
    """Return the object in a JSON column of a row, such as the labels of a trial. Raises DataDamaged."""
    try:
        value = json.loads(text)
    except (TypeError, ValueError) as error:
        raise damaged(Path(folder), f"a row has {text!r} instead of JSON ({error})") from error
    if not isinstance(value, dict):
        raise damaged(Path(folder), f"a row has {text!r} instead of a JSON object")
    return value


def is_new(folder: Path) -> bool:
    """Return whether the folder has no store yet.

    Raises DataDamaged for a file of another program and ConfigError for a newer version, before SQLite opens the file.
    """
    path = folder / FILE
    try:
        with path.open("rb") as file:
            header = file.read(_HEADER_BYTES)
    except FileNotFoundError:
        header = b""
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    if not header:
        if any((folder / RECORDINGS).glob("*.mcap")) and path.exists():
            raise DataDamaged(f"{path} is empty, but there are recordings. {_REPAIR.format(folder=folder)}")
        return True
    if len(header) < _HEADER_BYTES or not header.startswith(_MAGIC):
        raise DataDamaged(f"{path} is not an SQLite file. {_REPAIR.format(folder=folder)}")
    version, application = (int.from_bytes(header[offset : offset + 4], "big") for offset in (60, 68))
    _check_version(folder, version, application)
    return False


def checked_version(connection: sqlite3.Connection, folder: Path) -> int:
    """Return the version of an open store whose tables are exactly those of its version.

    Raises DataDamaged otherwise: another table, trigger or view could make SQLite run code.
    """
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    _check_version(folder, version, application)
    have, want = tables_in(connection), tables_of_version(version)
    if have != want:
        names = sorted({str(name) for _, name, _ in have ^ want})
        raise damaged(folder, f"its tables are not those of version {version} ({', '.join(names)[:200]})")
    return int(version)


def make_safe(connection: sqlite3.Connection) -> None:
    """Set the options under which SQLite does not trust the file."""
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    connection.execute("PRAGMA foreign_keys = ON")


def connect_read_only(path: Path) -> sqlite3.Connection:
    """Return a read-only connection, to a copy in memory where the log of a writer cannot be read in its place."""
    name = quote(os.fsencode(path.absolute()))
    connection = sqlite3.connect(f"file:{name}?mode=ro", uri=True, timeout=BUSY_S, isolation_level=None)
    try:
        connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()
        return connection
    except BaseException as error:
        connection.close()
        if getattr(error, "sqlite_errorcode", 0) & 0xFF not in _NO_SHARED_MEMORY:
            raise
    # A read-only or full disk has no place for the shared-memory file of readers. Without a writer none is needed.
    log = path.with_name(path.name + "-wal")
    if log.is_file() and log.stat().st_size:
        with tempfile.TemporaryDirectory(prefix="graspsense-") as folder:
            for source in (path, log):
                shutil.copyfile(source, Path(folder) / source.name)
            return in_memory(sqlite3.connect(Path(folder) / path.name))
    return sqlite3.connect(f"file:{name}?immutable=1", uri=True, isolation_level=None)


def in_memory(connection: sqlite3.Connection) -> sqlite3.Connection:
    """Return a copy of this database in memory, instead of the connection, which is closed."""
    with closing(connection):
        copy = sqlite3.connect(":memory:", isolation_level=None)
        connection.backup(copy)
    return copy


_NO_SHARED_MEMORY: Final = (
    sqlite3.SQLITE_CANTOPEN,
    sqlite3.SQLITE_READONLY,
    sqlite3.SQLITE_FULL,
    sqlite3.SQLITE_IOERR,
)
"""Results where the shared-memory file of readers cannot be made."""


@contextmanager
def sqlite_errors(folder: Path) -> Iterator[None]:
    """Translate errors of SQLite: SaveFailed with the reason if there is one, else DataDamaged."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:  # SQLite may quote damaged text
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
        reason = _REASONS.get(code)
        if reason is not None:
            raise SaveFailed(f"the store in {folder} {reason} ({error})") from error
        raise DataDamaged(
            f"the store in {folder} is damaged ({error}). {_REPAIR.format(folder=folder)}"
        ) from error


def refuse_read_fault(folder: Path, problem: str) -> None:
    """Raise SaveFailed if SQLite lists a page as a problem that the disk could not deliver."""
    code = re.search(r"error code=(\d+)", problem)
    if code is not None and int(code[1]) & 0xFF == sqlite3.SQLITE_IOERR:
        raise SaveFailed(f"the store in {folder} {_REASONS[sqlite3.SQLITE_IOERR]} ({problem})")


def _check_version(folder: Path, version: int, application: int) -> None:
    if application != APPLICATION_ID:
        raise DataDamaged(
            f"{folder / FILE} is not a store of graspsense: its application id is {application:#x}"
        )
    if version > NEWEST:
        raise ConfigError(
            f"the store in {folder} has version {version}. This graspsense ({__version__}) knows versions up to "
            f"{NEWEST} and does not change it. Update graspsense"
        )
    if version < 1:
        raise DataDamaged(f"the store in {folder} has no version. {_REPAIR.format(folder=folder)}")


_REASONS: Final = {
    sqlite3.SQLITE_FULL: "cannot be written: the disk is full",
    sqlite3.SQLITE_IOERR: "cannot be read or written: the disk reports an error or is full",
    sqlite3.SQLITE_READONLY: "cannot be written: it is read-only",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: check the permissions of its folder",
    sqlite3.SQLITE_PERM: "cannot be opened: check the permissions of its folder",
    sqlite3.SQLITE_BUSY: f"has been locked by another program for more than {BUSY_S:g} s",
    sqlite3.SQLITE_LOCKED: "is locked by another program",
}


STORE: Final = "store:"


def store_folder(text: str | os.PathLike[str]) -> str:
    """Return the folder of a store, however it is named: `store:trials`, `trials`, `trials/store.sqlite`.

    Raises ConfigError for an empty text.

    >>> store_folder("store:trials")
    'trials'
    """
    name = os.path.expanduser(text)
    if name.startswith(STORE) and not os.path.exists(name):
        name = os.path.expanduser(name.removeprefix(STORE))
    if not name:
        raise ConfigError(
            "an empty text names no folder: name the one of a store, or . for the current folder"
        )
    path = Path(name)
    return str(path.parent) if path.name == FILE and path.is_file() else name


def place_and_number(text: str) -> tuple[str, int | None]:
    """Return the two parts of `PLACE#NUMBER`, as of a trial of a store; the text itself and None if it has no number.

    >>> place_and_number("trials#12"), place_and_number("cup#b.toml")
    (('trials', 12), ('cup#b.toml', None))
    """
    place, _, number = text.rpartition("#")
    return (place, int(number)) if place and number.isdecimal() and len(number) <= 18 else (text, None)


def as_source(text: str) -> str:
    """Return a source of trials or recordings with `store:` before the folder of a store; others as they are."""
    if not text.startswith(STORE):
        for name, mark, number in ((text, "", ""), text.rpartition("#")):
            if name and os.path.isfile(os.path.join(folder := store_folder(name), FILE)):
                return f"{STORE}{folder}{mark}{number}"
    return text
