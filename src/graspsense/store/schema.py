"""The tables of the store's SQLite file, version by version.

A version is a list of statements; a store of an older version gets those that it lacks, in one transaction. A
statement that was once released is never changed: a new version is added.
"""

from __future__ import annotations

import sqlite3
from functools import cache
from typing import Final

APPLICATION_ID: Final = 0x47525350
"""`GRSP`: what `file` and sqlite3 know our files by."""

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
            whole INTEGER NOT NULL,
            set_aside TEXT,
            device TEXT NOT NULL,
            simulated INTEGER NOT NULL,
            recipe TEXT NOT NULL,
            feature_set INTEGER NOT NULL REFERENCES feature_set (id),
            "values" BLOB NOT NULL,
            before_set INTEGER NOT NULL REFERENCES feature_set (id),
            before BLOB NOT NULL,
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
            reasons TEXT NOT NULL,
            trial_json TEXT NOT NULL,
            recorder TEXT NOT NULL
        ) STRICT""",
        "CREATE INDEX trial_by_label ON trial (label, id)",
    ),
)
"""`trial` is what is searched and read as a table, `detail` what is read for one trial.

JSON is in one canonical form. `values` and `before` are little-endian float64 in the order of their feature set,
NaN where missing: so a hundred thousand rows are read as a table in a fraction of a second. `settings` is TOML,
`recipe` the hash of the settings without what differs from grasp to grasp. `sha256` is of all columns of both
tables but `id`, `set_aside` and itself.
"""

NEWEST: Final = len(VERSIONS)


def migrate(connection: sqlite3.Connection, version: int) -> None:
    """Bring the tables from this version to the newest, or leave them as they were.

    Raises sqlite3.Error.
    """
    connection.execute("BEGIN IMMEDIATE")
    try:
        # Somebody else may have done it while this waited for the lock.
        (version,) = connection.execute("PRAGMA user_version").fetchone()
        for statements in VERSIONS[version:]:
            for statement in statements:
                connection.execute(statement)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {NEWEST}")
        connection.execute("COMMIT")
    except BaseException:
        connection.execute("ROLLBACK")
        raise


@cache
def expected(version: int) -> frozenset[tuple[str, str, str]]:
    """Return kind, name and statement of everything that a store of this version holds, and nothing else does."""
    connection = sqlite3.connect(":memory:")
    try:
        for statements in VERSIONS[:version]:
            for statement in statements:
                connection.execute(statement)
        return found(connection)
    finally:
        connection.close()


def found(connection: sqlite3.Connection) -> frozenset[tuple[str, str, str]]:
    """Return the same of what this file holds. Raises sqlite3.Error."""
    rows = connection.execute("SELECT type, name, sql FROM sqlite_schema WHERE name NOT LIKE 'sqlite_%'")
    return frozenset(rows.fetchall())
