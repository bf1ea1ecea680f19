"""The store: what is kept is there, beside other programs, and a store that is not ours or newer is left alone."""

import errno
import json
import os
import re
import sqlite3
import struct
import subprocess
import sys
import threading
from contextlib import closing, suppress

import pytest
from cases import every_case
from commands import python
from kept import ended, keep, write_recording

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.recording.recording_info import RecordingInfo
from graspsense.store import schema
from graspsense.store.changes import set_aside
from graspsense.store.labels import labels_of
from graspsense.store.recover import recover_store
from graspsense.store.store import Store
from graspsense.store.stored_grasps import stored_grasp, stored_grasps
from graspsense.store.verify import verify_file, verify_store


@pytest.fixture
def store(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        yield store


def edited(store, *statements):
    """Close a store and change its file as another program would."""
    store.close()
    with closing(sqlite3.connect(store.folder / "store.sqlite")) as connection:
        for statement in statements:
            connection.execute(statement)
        connection.commit()


def assert_refused(store, error, says):
    for opened in (Store.open, Store.read):
        with pytest.raises(error, match=says):
            opened(store.folder)


def test_a_trial_comes_back_as_it_was_kept(store):
    values = (0.1 + 0.2, None)  # a number is kept to the last bit
    number = keep(store, "can:full_open", "can#2", values=values)
    with Store.read(store.folder) as reader:
        kept = reader.trial(number)
    summary = kept.summary
    assert (summary.label, summary.instance, summary.outcome) == ("can:full_open", "can#2", "steady")
    assert (summary.simulated, summary.device) == (True, "S1")
    assert kept.record == ended(values=values, label="can:full_open", instance="can#2")
    assert kept.recipe["controller"] == {"type": "graspsense/hybrid", "probing_force_n": 20.0}
    assert "object" not in kept.recipe["gripper"]
    assert kept.recording.is_file()


def test_only_complete_grasps_that_ended_by_themselves_and_are_not_set_aside_count(store):
    for outcome in ("steady", "aborted", "device lost", "nothing there"):
        keep(store, outcome=outcome)
    keep(store, complete=False)
    set_aside(store, [keep(store)], "undone")
    assert store.counts() == {("can:full_open", None): 2}
    assert [(summary.id, summary.set_aside) for summary in store.page(set_aside=True)] == [(6, "undone")]
    assert [summary.id for summary in store.page(limit=3)] == [5, 4, 3]
    assert verify_store(store.folder).problems == ()


def test_a_trial_without_details_is_named_until_it_is_set_aside(store):
    lost = keep(store)
    kept = keep(store)
    with store.transaction() as connection:
        connection.execute("DELETE FROM detail WHERE trial = ?", (lost,))
    with pytest.raises(DataDamaged, match=rf"#{lost} "):
        store.columns(("id", "labels"), "TRUE")
    set_aside(store, [lost], "lost")
    assert store.columns(("id",), "TRUE")["id"] == (kept,)


def test_a_number_that_is_not_there_says_which_are(store):
    with pytest.raises(ConfigError, match=r"trials .*trial 1"):
        store.trial(1)
    keep(store)
    with pytest.raises(ConfigError, match=r"trial 5.* 1 to 1"):
        set_aside(store, [5], "why")


@pytest.mark.slow
def test_readers_read_beside_a_writer_in_another_process(store):
    """A reader sees what was committed, while a transaction is open and after it."""
    keep(store)
    program = (
        "import sys; from graspsense.store.store import Store\n"
        "with Store.read(sys.argv[1]) as store: print(len(store.page()))"
    )
    with store.transaction() as connection:
        connection.execute("UPDATE trial SET set_aside = 'pending'")
        done = python("-c", program, store.folder)
    assert (done.stdout.strip(), done.stderr) == ("1", "")


def test_writers_wait_for_one_another(store):
    def write():
        with Store.open(store.folder) as mine:
            for _ in range(10):
                keep(mine, ticks=3)

    threads = [threading.Thread(target=write) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(summary.id for summary in store.page(limit=100)) == list(range(1, 41))


def test_a_recording_gets_one_row_whoever_writes_it(store):
    path = store.new_recording(ended().made_at)
    write_recording(path, 5, ended())
    info = RecordingInfo.hashed(path, 5, 1)
    assert store.add(ended(), info) == store.add(ended(), info) == 1
    assert len(store.page()) == 1


def bytes_in(folder):
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}


def test_a_newer_store_is_refused_and_not_a_byte_of_it_changes(store):
    keep(store)
    edited(store, f"PRAGMA user_version = {schema.NEWEST + 1}", "ALTER TABLE trial ADD COLUMN mood TEXT")
    contents = bytes_in(store.folder)
    assert_refused(store, ConfigError, f"version {schema.NEWEST + 1}.*Update graspsense")
    assert bytes_in(store.folder) == contents


def test_a_newer_version_that_only_the_log_knows_is_refused(store):
    """Another program has just migrated it and is still open: the main file has the old number."""
    store.close()
    with closing(sqlite3.connect(store.folder / "store.sqlite")) as writer:
        writer.execute("PRAGMA wal_autocheckpoint = 0")
        writer.execute(f"PRAGMA user_version = {schema.NEWEST + 1}")
        writer.commit()
        assert_refused(store, ConfigError, "Update graspsense")


def test_an_older_store_is_brought_up_to_date_with_all_that_is_in_it(tmp_path, monkeypatch):
    older = schema.VERSIONS
    with Store.open(tmp_path / "trials") as store:
        keep(store)
    newer = (*older, ("ALTER TABLE trial ADD COLUMN mood TEXT", "CREATE INDEX by_mood ON trial (mood)"))
    monkeypatch.setattr(schema, "VERSIONS", newer)
    schema.tables_of_version.cache_clear()
    monkeypatch.setattr(schema, "NEWEST", len(newer))
    for module in ("store", "opening"):
        monkeypatch.setattr(f"graspsense.store.{module}.NEWEST", len(newer))
    with Store.read(tmp_path / "trials") as store:
        assert store.trial(1).result.features.values == (0.066, 5.5)
        assert store.query("SELECT mood FROM trial") == [(None,)]
        assert store.query("PRAGMA user_version") == [(len(newer),)]
    schema.tables_of_version.cache_clear()


def test_a_migration_that_fails_leaves_the_store_as_it_was(tmp_path, monkeypatch):
    with Store.open(tmp_path / "trials") as store:
        keep(store)
    newer = (*schema.VERSIONS, ("ALTER TABLE trial ADD COLUMN mood TEXT", "CREATE TABLE trial (id)"))
    connection = sqlite3.connect(tmp_path / "trials" / "store.sqlite", isolation_level=None)
    tables = schema.tables_in(connection)
    monkeypatch.setattr(schema, "VERSIONS", newer)
    monkeypatch.setattr(schema, "NEWEST", len(newer))
    with pytest.raises(sqlite3.OperationalError, match="already exists"):
        schema.migrate(connection, len(newer) - 1)
    assert schema.tables_in(connection) == tables
    assert connection.execute("PRAGMA user_version").fetchone() == (len(newer) - 1,)
    connection.close()


@every_case(
    "statement",
    [
        "CREATE TRIGGER t AFTER INSERT ON trial BEGIN DELETE FROM detail; END",
        "CREATE VIEW v AS SELECT load_extension('x')",
        "DROP TABLE detail",
        "CREATE TABLE more (id)",
    ],
)
def test_a_store_that_holds_more_or_less_than_ours_do_is_refused(tmp_path, statement):
    """A trigger would run at the next trial; nothing that a store brings along is run."""
    store = Store.open(tmp_path / "trials")
    edited(store, statement)
    assert_refused(store, DataDamaged, "its tables are not those of version")


def of_somebody_else():
    with closing(sqlite3.connect(":memory:")) as connection:
        connection.execute("CREATE TABLE trial (id)")
        return connection.serialize()


@pytest.mark.parametrize(
    "content", [b"", b"a table of trials", b"SQLite format 3\0" + bytes(200), of_somebody_else()]
)
def test_what_is_no_store_is_told_and_left_alone(store, content):
    keep(store)
    store.close()
    path = store.folder / "store.sqlite"
    path.write_bytes(content)
    assert_refused(store, DataDamaged, r"recover|not a store of graspsense")
    assert path.read_bytes() == content


def test_reading_makes_no_store_and_opening_makes_it_whatever_its_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    name = "file:trials"  # which SQLite can take for an address
    with pytest.raises(ConfigError, match=rf"{name}.*store.sqlite"):
        Store.read(name)
    assert list(tmp_path.iterdir()) == []
    Store.open(name).close()
    assert (tmp_path / name / "store.sqlite").is_file()


def test_a_row_cannot_name_a_file_outside_of_the_store(store):
    number = keep(store)
    for name in ("../../etc/passwd", "a/b.mcap", "x.txt", ".hidden.mcap", ""):
        store._connection.execute("UPDATE trial SET recording = ?", (name,))
        with pytest.raises(DataDamaged, match=re.escape(repr(name))):
            store.trial(number)
        assert any(repr(name) in problem for problem in verify_store(store.folder).problems)


@every_case(
    ("column", "value"),
    [
        ("label", "can:empty_open"),
        ("outcome", "slipped"),
        ('"values"', struct.pack("<2d", 0.067, 5.5)),
        ("made_at", "2020-01-01"),
    ],
)
def test_a_row_that_was_changed_is_found_by_its_hash(tmp_path, column, value):
    with Store.open(tmp_path) as store:
        keep(store)
        number = keep(store)
        store._connection.execute(f"UPDATE trial SET {column} = ? WHERE id = ?", (value, number))
        (problem,) = verify_store(store.folder).problems
    assert problem.startswith(f"trial {number}: its row was changed")


@every_case(
    ("name", "error"),
    [("t.csv", ConfigError), ("a", ConfigError), ("t.mcap", DataDamaged), ("a.mcap.part", DataDamaged)],
)
def test_a_file_of_another_kind_is_not_called_damaged(tmp_path, name, error):
    (tmp_path / name).write_text("t,gap\n0,1\n")
    with pytest.raises(error, match=name):
        verify_file(tmp_path / name)


def test_verify_finds_what_became_of_recordings(store):
    paths = [store.trial(keep(store)).recording for _ in range(4)]
    paths[0].unlink()
    paths[1].write_bytes(paths[1].read_bytes()[:-50])
    data = paths[2].read_bytes()
    paths[2].write_bytes(data[:2000] + b"\0\0\0\0" + data[2004:])
    write_recording(store.recordings / "loose.mcap", 5, ended())
    findings = verify_store(store.folder)
    assert [problem.partition(":")[0] for problem in findings.problems] == ["trial 1", "trial 2", "trial 3"]
    assert "is missing" in findings.problems[0]
    assert "bytes and had" in findings.problems[1]
    assert "damaged" in findings.problems[2]
    assert findings.unfinished == ("loose.mcap has no row",)
    assert verify_file(store.folder / "store.sqlite") == findings


def test_a_whole_recording_in_the_place_of_another_one_is_not_taken_for_it(store):
    paths = [store.trial(keep(store, ticks=ticks)).recording for ticks in (20, 30)]
    grasp, _ = stored_grasps(store.folder)
    paths[0].write_bytes(paths[1].read_bytes())
    for read in (grasp.trace, lambda: stored_grasp(f"{store.folder}#1")):
        with pytest.raises(DataDamaged, match=f"{paths[0].name}.*aside"):
            read()


@pytest.mark.parametrize("log", [False, True], ids=["closed", "with a log"])
def test_a_store_on_a_read_only_disk_is_read_and_not_written(mounted, log):
    disk = mounted("size=20m")
    store = Store.open(disk)
    keep(store)
    if log:  # as if the program that wrote it had been killed: the last trial is in the log alone
        saved = {path.name: path.read_bytes() for path in disk.iterdir() if path.is_file()}
        store.close()
        for name, data in saved.items():
            (disk / name).write_bytes(data)
        (disk / "store.sqlite-shm").unlink()
    else:
        store.close()
    mounted("ro", remount=True)
    with Store.read(disk) as reader:
        assert reader.trial(1).result.features.values == (0.066, 5.5)
    assert verify_store(disk).problems == ()
    with pytest.raises(SaveFailed, match="read-only"):
        Store.open(disk)


def test_a_new_store_on_a_full_disk_is_not_called_damaged(mounted):
    disk = mounted("size=400k")
    with suppress(OSError):
        (disk / "filler").write_bytes(b"x" * 390_000)
    with pytest.raises(SaveFailed, match="full"):
        Store.open(disk / "store")
    (disk / "filler").unlink()
    Store.open(disk / "store").close()


@pytest.mark.slow
def test_a_grasp_ends_as_it_would_have_when_the_disk_fills_up_under_it(mounted):
    disk = mounted("size=200k")
    command = [sys.executable, "-m", "graspsense", "run", "-o", "classifier.type=none", "--save", str(disk)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 2
    assert "outcome     steady" in done.stdout
    assert os.strerror(errno.ENOSPC) in done.stderr
    assert "Traceback" not in done.stderr
    mounted("size=4m", remount=True)
    with Store.open(disk) as store:
        (recovered,) = recover_store(store)
        assert recovered.what == "recovered"
        assert recovered.ticks > 500


def test_a_word_says_class_state_and_thing():
    assert labels_of("can:full_open#2") == {"label": "can:full_open", "instance": "can#2"}
    assert labels_of("can:full_open") == {"label": "can:full_open"}
    assert labels_of("ball") == {"label": "ball"}
    for word in ("", "a b", "can:", "can:full:open", "unknown", "unknown:x", "#2"):
        with pytest.raises(ConfigError, match=re.escape(repr(word.partition(":x")[0]))):
            labels_of(word)


def test_the_file_is_readable_without_us(store):
    """With nothing but SQLite: labels, outcomes, and features as float64 in the order that stands beside them."""
    keep(store)
    with sqlite3.connect(store.folder / "store.sqlite") as connection:
        rows = connection.execute(
            """SELECT label, outcome, "values", json_extract(detail.device, '$.serial')
            FROM trial JOIN detail ON detail.trial = trial.id"""
        ).fetchall()
        (names,) = connection.execute("SELECT features FROM feature_set ORDER BY id LIMIT 1").fetchone()
    connection.close()
    assert rows == [("can:full_open", "steady", struct.pack("<2d", 0.066, 5.5), "S1")]
    assert json.loads(names)[0] == ["p_first", "m"]
