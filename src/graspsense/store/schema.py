"""The tables of the store's SQLite file, version by version.

A version is a list of statements. Opening an older store runs the statements that it lacks, in one transaction. Once
released, a statement never changes: a change is a new version.
"""

from __future__ import annotations

import sqlite3
from contextlib import closing, suppress
from functools import cache
from typing import Final

APPLICATION_ID: Final = 0x47525350
"""`GRSP`: the application id in the header of the SQLite file."""

VERSIONS: Final[tuple[tuple[str, ...], ...]] = (
    (
        """CREATE TABLE feature_set (
            id INTEGER PRIMARY KEY,
            features TEXT NOT NULL UNIQUE
        ) STRICT""",
        """CREATE TABLE trial (
            id INTEGER PRIMARY KEY,
            made_at TEXT NOT NULL,
            origin TEXT NOT NULL,
            label TEXT,
            instance TEXT,
            outcome TEXT NOT NULL,
            complete INTEGER NOT NULL,
            set_aside TEXT,
            device TEXT NOT NULL,
            simulated INTEGER NOT NULL,
            recipe TEXT NOT NULL,
            feature_set INTEGER NOT NULL REFERENCES feature_set (id),
            "values" BLOB NOT NULL,
            before_set INTEGER NOT NULL REFERENCES feature_set (id),
            before_contact BLOB NOT NULL,
            recording TEXT NOT NULL UNIQUE,
            recording_sha256 TEXT NOT NULL,
            recording_bytes INTEGER NOT NULL,
            sha256 TEXT NOT NULL
        ) STRICT""",
        """CREATE TABLE detail (
            trial INTEGER PRIMARY KEY REFERENCES trial (id),
            labels TEXT NOT NULL,
            settings TEXT NOT NULL,
            provenance TEXT NOT NULL,
            device TEXT NOT NULL,
            reason TEXT NOT NULL,
            missing TEXT NOT NULL,
            missing_before TEXT NOT NULL,
            details TEXT NOT NULL,
            recorder TEXT NOT NULL
        ) STRICT""",
        "CREATE INDEX trial_by_label ON trial (label, id)",
    ),
    (
        """CREATE TABLE change (
            id INTEGER PRIMARY KEY,
            trial INTEGER NOT NULL REFERENCES trial (id),
            made_at TEXT NOT NULL,
            "action" TEXT NOT NULL,
            "before" TEXT,
            "after" TEXT,
            why TEXT NOT NULL
        ) STRICT""",
        "CREATE INDEX change_by_trial ON change (trial, id)",
        """INSERT INTO change (trial, made_at, "action", why)
            SELECT id, '', 'aside', set_aside FROM trial WHERE set_aside IS NOT NULL ORDER BY id""",
    ),
)
"""`trial` holds what is searched and read as a table, `detail` what is read for one trial.

JSON is canonical. `"values"` and `before_contact` are little-endian float64 in the order of their feature set, with
NaN for a missing value, so a table of a hundred thousand rows is read in a fraction of a second. `settings` is TOML,
`recipe` the hash of the settings that the grasps of one experiment share. `reason` explains the outcome; `missing` and
`missing_before` state why features are missing. `sha256` covers all columns of both tables except `id`, `set_aside`
and itself. `label` and `instance` are the current ones; the column `labels` of `detail` has those of the recording.
`change` holds every change of them and of `set_aside` (`graspsense.store.changes`).
"""

NEWEST: Final = len(VERSIONS)


def migrate(connection: sqlite3.Connection, version: int) -> None:
    """Bring the tables from this version to the newest, or leave them unchanged and raise sqlite3.Error."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        # Another process may have migrated the store while this one waited for the lock.
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        for statements in VERSIONS[version:]:
            for statement in statements:
                connection.execute(statement)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {NEWEST}")
        connection.execute("COMMIT")
    except BaseException:
        # SQLite has rolled back by itself where the disk is full.
        with suppress(sqlite3.Error):
            connection.execute("ROLLBACK")
        raise


@cache
def tables_of_version(version: int) -> frozenset[tuple[str, str, str]]:
    """Return type, name and SQL of every table and index in a store of this version."""
    with closing(sqlite3.connect(":memory:")) as connection:
        for statements in VERSIONS[:version]:
            for statement in statements:
                connection.execute(statement)
        return tables_in(connection)


def tables_in(connection: sqlite3.Connection) -> frozenset[tuple[str, str, str]]:
    """Return type, name and SQL of every table and index in this file. Raises sqlite3.Error."""
    rows = connection.execute("SELECT type, name, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite_%'")
    return frozenset(rows.fetchall())
