"""The store: a folder with one SQLite file and the recordings of its trials.

    DIR/store.sqlite  DIR/recordings/*.mcap

A recording is complete on the disk before its row is written, and the row is written in one transaction. Readers can
work while a writer does. Nothing is ever deleted: an unwanted trial is set aside.
"""

from __future__ import annotations

import os
import re
import secrets
import sqlite3
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ConfigError, DataDamaged, named
from graspsense.recording.recording_info import RecordingInfo
from graspsense.recording.trial_record import TrialRecord
from graspsense.store.opening import (
    BUSY_S,
    FILE,
    RECORDINGS,
    checked_version,
    connect_read_only,
    damaged,
    in_memory,
    is_new,
    make_safe,
    place_and_number,
    refuse_read_fault,
    sqlite_errors,
    store_folder,
)
from graspsense.store.rows import (
    DETAIL_COLUMNS,
    SUMMARY_COLUMNS,
    TRIAL_COLUMNS,
    EncodedRow,
    StoredTrial,
    TrialSummary,
    decoded,
    encoded,
)
from graspsense.store.schema import NEWEST, migrate

RECORDING_NAME: Final = re.compile(r"[\w.-]+\.mcap")
NOT_ENDED: Final = ("aborted", "device lost", "recognised")
"""Outcomes of a grasp that did not end by itself. Such a trial is stored, but not learned from."""
COUNTS: Final = f"set_aside IS NULL AND complete = 1 AND outcome NOT IN {NOT_ENDED!r}"
"""SQL condition of the trials that count: complete, not set aside, and ended by themselves."""

_ROW_QUERY: Final = f"""SELECT trial.id, trial.sha256, own_set.features, before_set.features,
    {", ".join(f'trial."{name}"' for name in TRIAL_COLUMNS)}, {", ".join(f"detail.{name}" for name in DETAIL_COLUMNS)}
    FROM trial LEFT JOIN detail ON detail.trial = trial.id
    LEFT JOIN feature_set AS own_set ON own_set.id = trial.feature_set
    LEFT JOIN feature_set AS before_set ON before_set.id = trial.before_set"""


class Store:
    """An open store: `Store.open` to write, `Store.read` to read only. Close it, or use it in a `with` statement.

    Every method raises DataDamaged if the file is not what a store of this version is.
    """

    def __init__(self, folder: Path, connection: sqlite3.Connection) -> None:
        self.folder, self._connection = folder, connection

    @classmethod
    def open(cls, folder: str | Path) -> Store:
        """Open a store to write. Create it if there is none, and migrate one of an older version.

        Raises SaveFailed if it cannot be written, ConfigError if its version is newer, DataDamaged.
        """
        folder = Path(store_folder(folder))
        try:
            (folder / RECORDINGS).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise SaveFailed(
                f"cannot create a store in {folder}: {error.strerror}. Name a writable folder"
            ) from error
        if not all(os.access(path, os.W_OK) for path in (folder, folder / RECORDINGS)):
            raise SaveFailed(
                f"cannot write to the store in {folder}: it is read-only. Name a writable folder"
            )
        if (folder / FILE).exists() and not (folder / FILE).is_file():
            raise ConfigError(f"{folder / FILE} is not a file: move it away, or name another store")
        new = is_new(folder)
        with sqlite_errors(folder):
            # Absolute: SQLite can take a name that begins with `file:` for an address.
            path = (folder / FILE).absolute()
            connection = sqlite3.connect(path, timeout=BUSY_S, isolation_level=None)
            try:
                _prepare_to_write(connection, folder, new=new)
            except BaseException:
                connection.close()
                raise
        return cls(folder, connection)

    @classmethod
    def read(cls, folder: str | Path) -> Store:
        """Open a store to read only, also on a read-only disk; one of an older version is migrated in memory.

        Raises ConfigError if there is no store or its version is newer, DataDamaged.
        """
        folder = Path(store_folder(folder))
        path = folder / FILE
        if not path.is_file():
            place, number = place_and_number(str(folder))
            whole = f". A single trial is not taken here: write {place}" if number is not None else ""
            raise ConfigError(f"there is no store in {folder}: it has no file {FILE}{whole}")
        if is_new(folder):
            raise ConfigError(f"the store in {folder} is empty")
        with sqlite_errors(folder):
            connection = connect_read_only(path)
            try:
                make_safe(connection)
                version = checked_version(connection, folder)
                if version < NEWEST:
                    connection = in_memory(connection)
                    migrate(connection, version)
            except BaseException:
                connection.close()
                raise
        return cls(folder, connection)

    def close(self) -> None:
        """Close the store. Everything written is already on the disk."""
        self._connection.close()

    def __enter__(self) -> Store:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def recordings(self) -> Path:
        """The folder of the recordings."""
        return self.folder / RECORDINGS

    def new_recording(self, made_at: str) -> Path:
        """Return an unused path for a new recording."""
        stamp = re.sub(r"\D", "", made_at)[:14]
        return self.recordings / f"{stamp[:8]}-{stamp[8:]}-{secrets.token_hex(4)}.mcap"

    def add(self, record: TrialRecord, recording: RecordingInfo, *, complete: bool = True) -> int:
        """Add a trial whose recording is on the disk, and return its number.

        `record` must have a device and a result. Raises SaveFailed if the row cannot be written.
        """
        try:
            return self._add(encoded(record, recording, complete=complete), recording.path.name)
        except SaveFailed as error:
            raise SaveFailed(
                f"{error}. The grasp is complete in {recording.path.name}: then `graspsense recover {self.folder}` "
                "adds its trial"
            ) from error

    def _add(self, row: EncodedRow, recording: str) -> int:
        with self.transaction() as connection:
            columns = {
                **row.trial,
                "feature_set": _feature_set(connection, row.feature_set),
                "before_set": _feature_set(connection, row.before_set),
                "sha256": row.sha256,
            }
            names = ", ".join(f'"{name}"' for name in columns)
            inserted = connection.execute(
                f"INSERT INTO trial ({names}) VALUES ({', '.join('?' * len(columns))}) "
                "ON CONFLICT (recording) DO NOTHING RETURNING id",
                tuple(columns.values()),
            ).fetchone()
            if inserted is None:  # `recover` has already added a row for this recording
                query = "SELECT id FROM trial WHERE recording = ?"
                return int(connection.execute(query, (recording,)).fetchone()[0])
            number = int(inserted[0])
            connection.execute(
                f"INSERT INTO detail (trial, {', '.join(row.detail)}) VALUES (?{', ?' * len(row.detail)})",
                (number, *row.detail.values()),
            )
        return number

    def summary(self, number: int) -> TrialSummary:
        """Return the summary of a trial. Raises ConfigError if there is no trial of this number."""
        rows = self.query(f"SELECT {SUMMARY_COLUMNS} FROM trial WHERE id = ?", (number,))
        if not rows:
            ((oldest, newest),) = self.query("SELECT min(id), max(id) FROM trial")
            have = "it is empty" if newest is None else f"its trials are {oldest} to {newest}"
            raise ConfigError(f"the store in {self.folder} has no trial {number}: {have}")
        return TrialSummary.from_row(rows[0])

    def trial(self, number: int) -> StoredTrial:
        """Return everything that is stored of a trial. Raises ConfigError if there is no trial of this number."""
        summary = self.summary(number)
        _, row = self.encoded_row(number)
        try:
            return decoded(summary, row, self.recording_path(summary.recording))
        except MemoryError:
            raise
        except Exception as error:  # a row can hold any value in any place
            unread = f"trial {number} cannot be read ({named(error)})"
            raise damaged(self.folder, str(error) if isinstance(error, DataDamaged) else unread) from error

    def first_readable(self, numbers: Iterable[int]) -> StoredTrial:
        """Return the first of these trials that can be read; there is one. Raises DataDamaged if none can be."""
        damage = None
        for number in numbers:
            try:
                return self.trial(number)
            except DataDamaged as error:
                damage = damage or error
        assert damage is not None
        raise damage

    def encoded_row(self, number: int) -> tuple[str, EncodedRow]:
        """Return the stored hash and the columns of a trial. Raises DataDamaged if there are not all of them."""
        rows = self.query(f"{_ROW_QUERY} WHERE trial.id = ?", (number,))
        if len(rows) != 1 or None in rows[0][2:4] or rows[0][-1] is None:
            raise damaged(self.folder, f"trial {number} is not complete")
        _, sha256, row = _encoded_row(rows[0])
        return sha256, row

    def recording_path(self, name: str) -> Path:
        """Return the path of a recording. Raises DataDamaged if its name in the store is not valid."""
        if not RECORDING_NAME.fullmatch(name) or name.startswith("."):
            raise damaged(self.folder, f"{name[:60]!r} is not a name of a recording")
        return self.recordings / name

    def page(
        self,
        *,
        label: str | None = None,
        origin: str | None = None,
        set_aside: bool | None = False,
        limit: int = 50,
    ) -> list[TrialSummary]:
        """Return the newest trials that match, newest first.

        `set_aside` selects trials that were set aside or not; None selects both.
        """
        where, values = _filter({"label = ?": label, "origin = ?": origin})
        if set_aside is not None:
            where.append("set_aside IS NOT NULL" if set_aside else "set_aside IS NULL")
        query = f"SELECT {SUMMARY_COLUMNS} FROM trial" + (f" WHERE {' AND '.join(where)}" if where else "")
        rows = self.query(f"{query} ORDER BY id DESC LIMIT ?", (*values, limit))
        return [TrialSummary.from_row(row) for row in rows]

    def columns(
        self, names: Sequence[str], where: str, values: Sequence[object] = ()
    ) -> dict[str, tuple[Any, ...]]:
        """Return these columns of the trials that an SQL condition selects, oldest first; `device` is its name.

        Raises DataDamaged for a trial whose details are lost, unless it is set aside; then it is left out.
        """
        selected = ", ".join(
            f'{"detail" if name in DETAIL_COLUMNS and name != "device" else "trial"}."{name}"'
            for name in names
        )
        query = f"FROM trial LEFT JOIN detail ON detail.trial = trial.id WHERE {where}"
        for (lost,) in self.query(
            f"SELECT id {query} AND detail.trial IS NULL AND set_aside IS NULL", values
        ):
            raise DataDamaged(
                f"trial {lost} of {self.folder} has lost its details, such as its settings. To do without it: "
                f"graspsense trials aside {self.folder}#{lost} --why lost"
            )
        rows = self.query(f"SELECT {selected} {query} AND detail.trial IS NOT NULL ORDER BY id", values)
        return dict(zip(names, zip(*rows, strict=True) if rows else [()] * len(names), strict=True))

    def recording_names(self) -> set[str]:
        """Return the names of all recordings that have a row."""
        return {name for (name,) in self.query("SELECT recording FROM trial")}

    def counts(self, origin: str | None = None) -> dict[tuple[str, str | None], int]:
        """Return the number of trials that count for each label and instance."""
        where, values = _filter({"origin = ?": origin})
        query = f"""SELECT label, instance, count(*) FROM trial
            WHERE {" AND ".join((COUNTS, *where))} AND label IS NOT NULL GROUP BY label, instance"""
        return {(label, instance): n for label, instance, n in self.query(query, values)}

    def query(self, sql: str, values: Sequence[object] = ()) -> list[tuple[Any, ...]]:
        """Return the rows of a query by another module of this package."""
        with sqlite_errors(self.folder):
            return self._connection.execute(sql, tuple(values)).fetchall()

    @contextmanager
    def transaction(self) -> Iterator[sqlite3.Connection]:
        """Write in one transaction, for another module of this package: everything or, after an error, nothing.

        Raises SaveFailed if it cannot be written.
        """
        with sqlite_errors(self.folder):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):
                    self._connection.execute("ROLLBACK")
                raise


def stored_rows(store: Store) -> Iterator[tuple[int, str, EncodedRow]]:
    """Yield the number, the stored hash and the columns of each trial."""
    for row in store.query(f"{_ROW_QUERY} ORDER BY trial.id"):
        yield _encoded_row(row)


def integrity(store: Store) -> list[str]:
    """Return the problems that SQLite finds in the file. Raises SaveFailed if the disk cannot be read."""
    problems = [str(line) for (line,) in store.query("PRAGMA integrity_check(20)") if line != "ok"]
    for problem in problems:
        refuse_read_fault(store.folder, problem)
    return problems + [
        f"{row[0]} row {row[1]} has no {row[2]}" for row in store.query("PRAGMA foreign_key_check")
    ]


def _prepare_to_write(connection: sqlite3.Connection, folder: Path, *, new: bool) -> None:
    make_safe(connection)
    if new:
        # Before WAL mode, so that the file has its application id from the first byte on.
        migrate(connection, 0)
    version = checked_version(connection, folder)
    if version < NEWEST:
        migrate(connection, version)
    connection.execute("PRAGMA journal_mode = WAL")
    connection.execute("PRAGMA synchronous = FULL")
    # Write once, to learn before the grasp rather than after it that nothing can be written.
    connection.execute("BEGIN IMMEDIATE")
    connection.execute(f"PRAGMA user_version = {NEWEST}")
    connection.execute("COMMIT")


def _encoded_row(row: Sequence[Any]) -> tuple[int, str, EncodedRow]:
    number, sha256, feature_set, before_set, *columns = row
    trial = dict(zip(TRIAL_COLUMNS, columns[: len(TRIAL_COLUMNS)], strict=True))
    detail = dict(zip(DETAIL_COLUMNS, columns[len(TRIAL_COLUMNS) :], strict=True))
    return (
        number,
        sha256,
        EncodedRow(trial=trial, detail=detail, feature_set=feature_set, before_set=before_set),
    )


def _feature_set(connection: sqlite3.Connection, features: str) -> int:
    connection.execute("INSERT INTO feature_set (features) VALUES (?) ON CONFLICT DO NOTHING", (features,))
    ((number,),) = connection.execute("SELECT id FROM feature_set WHERE features = ?", (features,)).fetchall()
    return int(number)


def _filter(conditions: Mapping[str, object]) -> tuple[list[str], list[object]]:
    given = {condition: value for condition, value in conditions.items() if value is not None}
    return list(given), list(given.values())
