"""The store: a folder with one SQLite file and the recordings of its trials.

    DIR/store.sqlite  DIR/recordings/*.mcap

A recording is whole on the disk before its row is written, and the row comes in one transaction. Readers work
beside a writer. Nothing is ever deleted: a trial that is not wanted is set aside.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import secrets
import shutil
import sqlite3
import struct
import tempfile
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from math import isnan
from pathlib import Path
from types import TracebackType
from typing import Any, Final
from urllib.parse import quote

from attrs import frozen

from graspsense import __version__
from graspsense.core.errors import ConfigError, DataDamaged
from graspsense.core.json_values import json_text
from graspsense.recording.provenance import recipe
from graspsense.recording.recorder import NotKept
from graspsense.recording.trial_record import Beginning, Ending
from graspsense.store.schema import APPLICATION_ID, NEWEST, expected, found, migrate

FILE: Final = "store.sqlite"
RECORDINGS: Final = "recordings"
RECORDING_NAME: Final = re.compile(r"[\w.-]+\.mcap")
BUSY_S: Final = 30.0
NOT_ENDED: Final = ("aborted", "device lost")
"""Outcomes of a grasp that did not end by itself: kept, but nothing to learn from."""

_MAGIC: Final = b"SQLite format 3\0"
_TRIAL: Final = (
    "made_at",
    "origin",
    "label",
    "instance",
    "outcome",
    "whole",
    "device",
    "simulated",
    "recipe",
    "values",
    "before",
    "recording",
    "recording_sha256",
    "recording_bytes",
)
_DETAIL: Final = ("labels", "settings", "provenance", "device", "reasons", "trial_json", "recorder")


@frozen(kw_only=True)
class RecordingFacts:
    """What the store knows of a recording: its name in `recordings`, hash, size, and how its writing went."""

    name: str
    sha256: str
    size: int
    counts: Mapping[str, int]


@frozen(kw_only=True)
class Listed:
    """A trial as a list shows it."""

    id: int
    made_at: str
    origin: str
    label: str | None
    instance: str | None
    outcome: str
    whole: bool
    set_aside: str | None
    device: str
    simulated: bool
    recording: str

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {name: getattr(self, name) for name in Listed.__annotations__}


@frozen(kw_only=True)
class Kept:
    """One trial with everything that is kept of it besides its recording."""

    listed: Listed
    features: tuple[tuple[str, str], ...]
    values: tuple[float | None, ...]
    labels: Mapping[str, str]
    settings: str
    recipe: Mapping[str, Mapping[str, Any]]
    provenance: Mapping[str, Any]
    device: Mapping[str, Any]
    trial: Mapping[str, Any]
    recorder: Mapping[str, Any]
    recording: Path
    recording_sha256: str
    recording_bytes: int


class Store:
    """A store that is open; `Store.open` to write, `Store.read` to read only. Close it, or use it in a `with`.

    Every method raises DataDamaged where the file turns out not to be what a store of this version is.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection, copy: Path | None = None) -> None:
        self.folder, self._connection, self._copy = folder, connection, copy

    @classmethod
    def open(cls, folder: str | Path) -> Store:
        """Open a store to write, making it where there is none, and bringing an older one to this version.

        Raises NotKept where it cannot be written, ConfigError for one of a newer version, DataDamaged.
        """
        folder = Path(folder).expanduser()
        try:
            (folder / RECORDINGS).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise NotKept(
                f"cannot keep a trial below {folder}: {error.strerror}. Name a folder to write in"
            ) from error
        if not all(os.access(one, os.W_OK) for one in (folder, folder / RECORDINGS)):
            raise NotKept(f"cannot keep a trial below {folder}: it is read-only. Name a folder to write in")
        new = _header(folder)
        with _told(folder):
            connection = sqlite3.connect(folder / FILE, timeout=BUSY_S, isolation_level=None)
            try:
                _careful(connection)
                if new:
                    # In the plain mode, so that the file says what it is from its first byte on.
                    migrate(connection, 0)
                version = _checked(connection, folder)
                if version < NEWEST:
                    migrate(connection, version)
                connection.execute("PRAGMA journal_mode = WAL")
                connection.execute("PRAGMA synchronous = FULL")
                # To find out now, not after the grasp, that nothing can be written.
                connection.execute("BEGIN IMMEDIATE")
                connection.execute(f"PRAGMA user_version = {NEWEST}")
                connection.execute("COMMIT")
            except BaseException:
                connection.close()
                raise
        return cls(folder, connection)

    @classmethod
    def read(cls, folder: str | Path) -> Store:
        """Open a store to read only, on a read-only disk too.

        Raises ConfigError where there is none, or one of a newer version, DataDamaged.
        """
        folder = Path(folder).expanduser()
        path = folder / FILE
        if not path.is_file():
            raise ConfigError(f"there is no store in {folder}: it has no file {FILE}")
        if _header(folder):
            raise ConfigError(f"the store in {folder} is empty")
        with _told(folder):
            store = cls(folder, *_reader(path))
            try:
                _careful(store._connection)
                version = _checked(store._connection, folder)
            except BaseException:
                store.close()
                raise
        if version < NEWEST:
            store.close()
            cls.open(folder).close()
            return cls.read(folder)
        return store

    def close(self) -> None:
        """Close it; what was written is on the disk already."""
        self._connection.close()
        if self._copy is not None:
            shutil.rmtree(self._copy, ignore_errors=True)

    def __enter__(self) -> Store:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None
    ) -> None:
        self.close()

    @property
    def recordings(self) -> Path:
        """The folder of the recordings."""
        return self.folder / RECORDINGS

    def new_recording(self, made_at: str) -> Path:
        """Return the path of a recording to be made, a name that no other has."""
        stamp = re.sub(r"\D", "", made_at)[:14]
        return self.recordings / f"{stamp[:8]}-{stamp[8:]}-{secrets.token_hex(4)}.mcap"

    def add(
        self,
        beginning: Beginning,
        ending: Ending,
        device: Mapping[str, Any],
        recording: RecordingFacts,
        *,
        whole: bool = True,
    ) -> int:
        """Add a trial whose recording is on the disk, and return its number. Raises NotKept."""
        settings = tomllib.loads(beginning.settings)
        features, before = ending.features, ending.before
        trial = {
            "made_at": beginning.made_at,
            "origin": beginning.origin,
            "label": beginning.labels.get("label"),
            "instance": beginning.labels.get("instance"),
            "outcome": str(ending.trial["outcome"]),
            "whole": int(whole),
            "device": str(device.get("serial") or device.get("name", "")),
            # An object by name is there only where somebody put it there: in a simulation.
            "simulated": int(bool(settings["gripper"].get("object"))),
            "recipe": _hash(json_text(recipe(settings))),
            "values": features.packed(),
            "before": before.packed(),
            "recording": recording.name,
            "recording_sha256": recording.sha256,
            "recording_bytes": recording.size,
        }
        detail = {
            "labels": json_text(beginning.labels),
            "settings": beginning.settings,
            "provenance": json_text(beginning.provenance),
            "device": json_text(device),
            "reasons": json_text(features.reasons),
            "trial_json": json_text(ending.trial),
            "recorder": json_text(recording.counts),
        }
        sets = [json_text([list(pair) for pair in one.features]) for one in (features, before)]
        with _told(self.folder), self._transaction() as connection:
            numbers = [_feature_set(connection, one) for one in sets]
            row = {
                **trial,
                "feature_set": numbers[0],
                "before_set": numbers[1],
                "sha256": row_sha256(sets, trial, detail),
            }
            names = ", ".join(f'"{name}"' for name in row)
            inserted = connection.execute(
                f"INSERT INTO trial ({names}) VALUES ({', '.join('?' * len(row))}) "
                "ON CONFLICT (recording) DO NOTHING RETURNING id",
                tuple(row.values()),
            ).fetchone()
            if inserted is None:  # `recover` found the recording before its row was written, and wrote it
                known = connection.execute("SELECT id FROM trial WHERE recording = ?", (recording.name,))
                return int(known.fetchone()[0])
            number = int(inserted[0])
            connection.execute(
                f"INSERT INTO detail (trial, {', '.join(detail)}) VALUES (?{', ?' * len(detail)})",
                (number, *detail.values()),
            )
        return number

    def set_aside(self, number: int, why: str) -> None:
        """Set a trial aside: it stays, but is neither counted nor learned from. Raises ConfigError, NotKept."""
        self.listed(number)
        with _told(self.folder), self._transaction() as connection:
            connection.execute("UPDATE trial SET set_aside = ? WHERE id = ?", (why, number))

    def listed(self, number: int) -> Listed:
        """Return a trial as a list shows it. Raises ConfigError where there is none of this number."""
        rows = self._rows(f"SELECT {_LISTED} FROM trial WHERE id = ?", (number,))
        if not rows:
            ((first, last),) = self._rows("SELECT min(id), max(id) FROM trial")
            have = "it has none yet" if last is None else f"its trials are {first} to {last}"
            raise ConfigError(f"the store in {self.folder} has no trial {number}: {have}")
        return _listed(rows[0])

    def trial(self, number: int) -> Kept:
        """Return everything that is kept of a trial. Raises ConfigError where there is none of this number."""
        listed = self.listed(number)
        query = f"""SELECT feature_set.features, trial."values", recording_sha256, recording_bytes,
            {", ".join(f"detail.{name}" for name in _DETAIL)}
            FROM trial JOIN detail ON detail.trial = trial.id
            JOIN feature_set ON feature_set.id = trial.feature_set WHERE trial.id = ?"""
        rows = self._rows(query, (number,))
        if len(rows) != 1:
            raise self._damaged(f"trial {number} is not complete")
        features, values, sha256, size, labels, settings, made, device, _, trial, recorder = rows[0]
        with self._parsing(number):
            return Kept(
                listed=listed,
                features=tuple((str(name), str(unit)) for name, unit in json.loads(features)),
                values=tuple(None if isnan(one) else one for (one,) in struct.iter_unpack("<d", values)),
                labels=_table(labels),
                settings=settings,
                recipe=recipe(tomllib.loads(settings)),
                provenance=_table(made),
                device=_table(device),
                trial=_table(trial),
                recorder=_table(recorder),
                recording=self.recording_of(listed.recording),
                recording_sha256=sha256,
                recording_bytes=size,
            )

    def recording_of(self, name: str) -> Path:
        """Return the path of a recording by its name in the store. Raises DataDamaged for what is no such name."""
        if not RECORDING_NAME.fullmatch(name) or name.startswith("."):
            raise self._damaged(f"{name[:60]!r} is no name of a recording")
        return self.recordings / name

    def page(
        self,
        *,
        label: str | None = None,
        outcome: str | None = None,
        origin: str | None = None,
        since: str | None = None,
        set_aside: bool | None = False,
        before: int | None = None,
        limit: int = 50,
    ) -> list[Listed]:
        """Return the newest trials that fit, newest first; `before` is the number that the page ends before.

        `since` is a time in ISO 8601. `set_aside` None takes in those that were set aside as well.
        """
        where, values = _filter(
            {
                "label = ?": label,
                "outcome = ?": outcome,
                "origin = ?": origin,
                "made_at >= ?": since,
                "id < ?": before,
            }
        )
        if set_aside is not None:
            where.append("set_aside IS NOT NULL" if set_aside else "set_aside IS NULL")
        query = f"SELECT {_LISTED} FROM trial" + (f" WHERE {' AND '.join(where)}" if where else "")
        return [_listed(row) for row in self._rows(f"{query} ORDER BY id DESC LIMIT ?", (*values, limit))]

    def names(self) -> set[str]:
        """Return the names of all recordings that have a row."""
        return {name for (name,) in self._rows("SELECT recording FROM trial")}

    def counts(self, origin: str | None = None) -> dict[tuple[str, str | None], int]:
        """Return how many trials count for each label and instance."""
        where, values = _filter({"origin = ?": origin})
        query = f"""SELECT label, instance, count(*) FROM trial
            WHERE {" AND ".join((COUNTS, *where))} AND label IS NOT NULL GROUP BY label, instance"""
        return {(label, instance): n for label, instance, n in self._rows(query, values)}

    def query(self, sql: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Return the rows of a query by another part of this package."""
        return self._rows(sql, values)

    @contextmanager
    def _transaction(self) -> Iterator[sqlite3.Connection]:
        self._connection.execute("BEGIN IMMEDIATE")
        try:
            yield self._connection
            self._connection.execute("COMMIT")
        except BaseException:
            with suppress(sqlite3.Error):
                self._connection.execute("ROLLBACK")
            raise

    def _rows(self, sql: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        with _told(self.folder):
            return self._connection.execute(sql, tuple(values)).fetchall()

    @contextmanager
    def _parsing(self, number: int) -> Iterator[None]:
        try:
            yield
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, struct.error) as error:
            raise self._damaged(f"trial {number} cannot be read ({type(error).__name__}: {error})") from error

    def _damaged(self, what: str) -> DataDamaged:
        return DataDamaged(
            f"the store in {self.folder} is damaged: {what}. {_AID.format(folder=self.folder)}"
        )


COUNTS: Final = f"set_aside IS NULL AND whole = 1 AND outcome NOT IN {NOT_ENDED!r}"
"""The trials that count: whole, not set aside, and ended by themselves."""

_LISTED: Final = ", ".join(Listed.__annotations__)
_AID: Final = (
    "`graspsense verify {folder}` says what is whole. The recordings hold everything: move "
    + FILE
    + " away, and `graspsense recover {folder}` makes a new one from them"
)


def row_sha256(sets: Sequence[str], trial: Mapping[str, Any], detail: Mapping[str, Any]) -> str:
    """Return the hash of a row: of both feature sets and of the columns of both tables."""
    columns = [*sets, *(trial[name] for name in _TRIAL), *(detail[name] for name in _DETAIL)]
    return _hash(json_text([one.hex() if isinstance(one, bytes) else one for one in columns]))


def stored_rows(store: Store) -> Iterator[tuple[int, str, str, int, str, str]]:
    """Yield of each trial its number, recording, the recording's hash and size, and its hash as stored and as found."""
    query = f"""SELECT trial.id, trial.sha256, one.features, two.features,
        {", ".join(f'trial."{name}"' for name in _TRIAL)}, {", ".join(f"detail.{name}" for name in _DETAIL)}
        FROM trial LEFT JOIN detail ON detail.trial = trial.id
        LEFT JOIN feature_set AS one ON one.id = trial.feature_set
        LEFT JOIN feature_set AS two ON two.id = trial.before_set ORDER BY trial.id"""
    for number, sha256, one, two, *columns in store.query(query):
        trial = dict(zip(_TRIAL, columns[: len(_TRIAL)], strict=True))
        detail = dict(zip(_DETAIL, columns[len(_TRIAL) :], strict=True))
        really = row_sha256((one, two), trial, detail)
        yield number, trial["recording"], trial["recording_sha256"], trial["recording_bytes"], sha256, really


def integrity(store: Store) -> list[str]:
    """Return what SQLite finds wrong with the file."""
    found_wrong = [str(line) for (line,) in store.query("PRAGMA integrity_check(20)") if line != "ok"]
    return found_wrong + [
        f"{row[0]} row {row[1]} has no {row[2]}" for row in store.query("PRAGMA foreign_key_check")
    ]


def _header(folder: Path) -> bool:
    """Return whether there is no store yet. Raises before SQLite has touched what is none of ours or newer."""
    path = folder / FILE
    try:
        with path.open("rb") as file:
            head = file.read(100)
    except FileNotFoundError:
        head = b""
    except OSError as error:
        raise ConfigError(f"{path} cannot be read: {error.strerror}") from error
    if not head:
        if any((folder / RECORDINGS).glob("*.mcap")) and path.exists():
            raise DataDamaged(f"{path} is empty, but there are recordings. {_AID.format(folder=folder)}")
        return True
    if len(head) < 100 or not head.startswith(_MAGIC):
        raise DataDamaged(f"{path} is no SQLite file. {_AID.format(folder=folder)}")
    version, application = (int.from_bytes(head[at : at + 4], "big") for at in (60, 68))
    _refuse(folder, version, application)
    return False


def _refuse(folder: Path, version: int, application: int) -> None:
    if application != APPLICATION_ID:
        raise DataDamaged(
            f"{folder / FILE} is no store of graspsense: its application id is {application:#x}"
        )
    if version > NEWEST:
        raise ConfigError(
            f"the store in {folder} has version {version}; this graspsense ({__version__}) knows versions up to "
            f"{NEWEST} and leaves it alone. Update graspsense"
        )
    if version < 1:
        raise DataDamaged(f"the store in {folder} has no version. {_AID.format(folder=folder)}")


def _checked(connection: sqlite3.Connection, folder: Path) -> int:
    """Return the version of a store that holds what its version holds, and nothing that could run."""
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    (application,) = connection.execute("PRAGMA application_id").fetchone()
    _refuse(folder, version, application)
    have, want = found(connection), expected(version)
    if have != want:
        names = sorted({str(name) for _, name, _ in have ^ want})
        raise DataDamaged(
            f"the store in {folder} is damaged: its tables are not those of version {version} "
            f"({', '.join(names)[:200]}). {_AID.format(folder=folder)}"
        )
    return int(version)


def _careful(connection: sqlite3.Connection) -> None:
    connection.execute("PRAGMA trusted_schema = OFF")
    connection.execute("PRAGMA cell_size_check = ON")
    connection.execute("PRAGMA foreign_keys = ON")


def _reader(path: Path) -> tuple[sqlite3.Connection, Path | None]:
    """Return a connection that only reads, and the folder of the copy where one had to be made."""
    name = quote(str(path.absolute()))
    connection = sqlite3.connect(f"file:{name}?mode=ro", uri=True, timeout=BUSY_S, isolation_level=None)
    try:
        connection.execute("SELECT count(*) FROM sqlite_schema").fetchone()
        return connection, None
    except sqlite3.OperationalError as error:
        connection.close()
        if error.sqlite_errorcode & 0xFF not in (sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_READONLY):
            raise
    except BaseException:
        connection.close()
        raise
    # A disk that takes no file for what readers share. Nobody writes there, so nothing has to be shared.
    log = path.with_name(path.name + "-wal")
    if log.is_file() and log.stat().st_size:
        copy = Path(tempfile.mkdtemp(prefix="graspsense-"))
        for one in (path, log):
            shutil.copyfile(one, copy / one.name)
        return sqlite3.connect(copy / path.name, isolation_level=None), copy
    return sqlite3.connect(f"file:{name}?immutable=1", uri=True, isolation_level=None), None


@contextmanager
def _told(folder: Path) -> Iterator[None]:
    """Turn what SQLite says into what a user can act on."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:  # what SQLite says may quote the damage
        code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF
        reason = _REASONS.get(code)
        if reason is not None:
            raise NotKept(f"the store in {folder} {reason} ({error})") from error
        raise DataDamaged(
            f"the store in {folder} is damaged ({error}). {_AID.format(folder=folder)}"
        ) from error


_REASONS: Final = {
    sqlite3.SQLITE_FULL: "cannot be written: the disk is full",
    sqlite3.SQLITE_IOERR: "cannot be read or written: the disk reports an error or is full",
    sqlite3.SQLITE_READONLY: "cannot be written: it is read-only",
    sqlite3.SQLITE_CANTOPEN: "cannot be opened: check the rights on its folder",
    sqlite3.SQLITE_PERM: "cannot be opened: check the rights on its folder",
    sqlite3.SQLITE_BUSY: f"is being written by another program for over {BUSY_S:g} s",
    sqlite3.SQLITE_LOCKED: "is locked by another program",
}


def _feature_set(connection: sqlite3.Connection, features: str) -> int:
    connection.execute("INSERT INTO feature_set (features) VALUES (?) ON CONFLICT DO NOTHING", (features,))
    ((number,),) = connection.execute("SELECT id FROM feature_set WHERE features = ?", (features,)).fetchall()
    return int(number)


def _filter(conditions: Mapping[str, object]) -> tuple[list[str], list[object]]:
    given = {condition: value for condition, value in conditions.items() if value is not None}
    return list(given), list(given.values())


def _listed(row: Sequence[Any]) -> Listed:
    values = dict(zip(Listed.__annotations__, row, strict=True))
    return Listed(**{**values, "whole": bool(values["whole"]), "simulated": bool(values["simulated"])})


def _table(text: str) -> dict[str, Any]:
    value = json.loads(text)
    if not isinstance(value, dict):
        raise TypeError("no table")
    return value


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()
