"""Recover: whatever a killed program left, nothing that was felt and reached the disk is lost."""

import errno
import json
import shutil
from unittest.mock import Mock

import pytest
from attrs import evolve
from commands import answered, graspsense
from kept import begun, ended, keep, pads, write_recording
from mcap.reader import make_reader

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.experiments.results import Results
from graspsense.recording.reader import read_recorded
from graspsense.store.recover import recover_file, recover_store
from graspsense.store.store import Store
from graspsense.store.verify import verify_store


@pytest.fixture
def store(tmp_path):
    with Store.open(tmp_path / "trials") as store:
        yield store


def part(store, name="20261121-103015-0001.mcap", ticks=200):
    """Leave a recording as a process does that was killed: not ended, under its passing name."""
    file = write_recording(store.recordings / name, ticks, begun(), finish=False)
    file._out.close()
    return store.recordings / f"{name}.part"


def test_a_cut_recording_becomes_a_trial_that_does_not_count(store):
    part(store)
    (recovered,) = recover_store(store)
    assert (recovered.what, recovered.trial) == ("recovered", 1)
    # Of 200 ticks, those of the last chunk that was closed are there: 50 ms of 1 kHz at most are missing.
    assert 150 <= recovered.ticks <= 200
    kept = store.trial(1)
    summary = kept.summary
    assert (summary.outcome, summary.complete, summary.label) == ("aborted", False, "can:full_open")
    assert "were recovered" in kept.result.reason
    # Extracted with the settings in the recording.
    assert (kept.result.features.names[0], kept.result.features.units[0]) == ("p_first", "m")
    counters = [reading.pads.counter for reading in read_recorded(kept.recording).readings()]
    assert counters == [pads(k).counter for k in range(recovered.ticks)], "each image is that of its tick"
    with kept.recording.open("rb") as file:  # complete for other readers: it has a summary again
        assert make_reader(file).get_summary().statistics.channel_message_counts[1] == recovered.ticks
    names = sorted(file.name for file in store.recordings.iterdir())
    assert "20261121-103015-0001.mcap.cut" in names
    assert store.counts() == {}
    verified = verify_store(store.folder)
    assert (verified.as_json()["intact"], verified.trials, verified.recordings) == (True, 1, 1)
    assert verified.unfinished == ()
    # To recover twice changes nothing.
    assert recover_store(store) == []
    assert sorted(file.name for file in store.recordings.iterdir()) == names


def test_a_finished_trial_that_only_lacks_its_row_counts(store):
    write_recording(store.recordings / "a.mcap", 100, ended())
    file = write_recording(store.recordings / "b.mcap", 100, ended(), finish=False)
    file.leave()  # ended, but not renamed
    assert [(recovered.what, recovered.trial) for recovered in recover_store(store)] == [
        ("added", 1),
        ("added", 2),
    ]
    assert store.counts() == {("can:full_open", None): 2}
    assert store.trial(1).result.features.values == (0.066, 5.5)
    assert store.trial(1).summary.made_at == begun().made_at


def test_recovery_that_was_killed_itself_is_done_again(store):
    path = part(store)
    copy = path.with_name("20261121-103015-0001-recovered.mcap")
    write_recording(copy, 3, begun(), finish=False)._out.close()
    (recovered,) = recover_store(store)
    assert (recovered.what, recovered.recording) == ("recovered", copy)
    assert len(read_recorded(copy)) == recovered.ticks > 100
    # And killed after the copy was written, before the row was.
    store._connection.execute("DELETE FROM detail")
    store._connection.execute("DELETE FROM trial")
    shutil.move(path.with_name("20261121-103015-0001.mcap.cut"), path)
    recover_store(store)
    assert len(store.page()) == 1


def test_a_recording_that_is_being_written_is_left_alone(store):
    file = write_recording(store.recordings / "a.mcap", 100, ended(), finish=False)
    (recovery,) = recover_store(store)
    assert (recovery.what, recovery.why) == ("busy", "it is being written")
    assert verify_store(store.folder).unfinished == ()
    file.finish()
    assert [recovered.what for recovered in recover_store(store)] == ["added"]


def test_on_a_disk_without_locks_only_what_may_be_being_written_is_left_alone(store, monkeypatch):
    path = part(store)
    monkeypatch.setattr("fcntl.flock", Mock(side_effect=OSError(errno.ENOLCK, "No locks available")))
    keep(store)
    (recovery,) = recover_store(store)
    assert (recovery.what, path.exists(), "locks" in recovery.why) == ("busy", True, True)
    assert len(verify_store(store.folder).unfinished) == 1
    with Results(store.folder.parent / "results").alone():
        pass


def test_a_recording_is_not_replaced_by_an_unfinished_one_of_its_name(store):
    keep(store)
    path = store.trial(1).recording
    original = path.read_bytes()
    write_recording(store.recordings / "b.mcap", 100, ended(), finish=False).leave()
    (store.recordings / "b.mcap.part").rename(path.with_name(f"{path.name}.part"))
    (recovered,) = recover_store(store)
    assert (recovered.what, path.read_bytes()) == ("failed", original)
    assert verify_store(store.folder).problems == ()


def test_a_file_without_a_tick_makes_no_trial_and_unreadable_settings_are_told(store):
    for k, bytes_written in enumerate((None, 0, 5, 60)):
        path = part(store, f"{k}.mcap", ticks=0)
        path.write_bytes(path.read_bytes()[:bytes_written])  # a disk can be full at the first byte
    assert [recovered.what for recovered in recover_store(store)] == ["empty"] * 4
    assert store.page(set_aside=None) == []
    for k, settings in enumerate(("no TOML at all [", "[features]\n", "")):
        write_recording(store.recordings / f"settings{k}.mcap", 100, ended(), settings=settings)
    failed = [recovered for recovered in recover_store(store) if recovered.what != "empty"]
    assert [recovered.what for recovered in failed] == ["failed"] * 3
    assert len(list(store.recordings.glob("settings*.mcap"))) == 3


def test_a_feature_set_that_is_not_installed_does_not_lose_the_trial(store):
    settings = begun().settings_text.replace("graspsense/chitta", "elsewhere/mine")
    write_recording(store.recordings / "a.mcap", 100, begun(settings=settings))
    (recovered,) = recover_store(store)
    assert (recovered.what, recovered.trial) == ("recovered", 1)
    assert "elsewhere/mine" in json.loads(store.query("SELECT missing FROM detail")[0][0])[""]


def test_recordings_without_a_database_get_their_numbers_in_the_order_of_recording(store):
    for name, hour in (("c.mcap", 10), ("a.mcap", 11), ("b.mcap", 9)):
        record = evolve(ended(label=f"hour:{hour}"), made_at=f"2026-11-21T{hour:02}:00:00.000+00:00")
        write_recording(store.recordings / name, 60, record)
    recover_store(store)

    assert [summary.label for summary in reversed(store.page())] == ["hour:9", "hour:10", "hour:11"]


def test_a_damaged_file_alone_is_written_anew_as_far_as_it_can_be_read(tmp_path):
    path = tmp_path / "g.mcap"
    write_recording(path, 300, ended())
    data = path.read_bytes()
    middle = data[: len(data) // 2] + b"\0\0\0\0" + data[len(data) // 2 + 4 :]
    path.write_bytes(middle)
    recovery = recover_file(path)
    assert path.read_bytes() == middle
    assert recovery.recording == tmp_path / "g-recovered.mcap"
    # One chunk of 51 ticks is lost and no other; the ticks that are there are right.
    again = read_recorded(recovery.recording)
    assert 240 <= len(again) < 300
    assert set(again.ticks["t_s"].tolist()) <= {10.0 + k * 0.001 for k in range(300)}
    assert "are lost" in recovery.why
    with pytest.raises(SaveFailed, match="already exists"):
        recover_file(path)


def test_what_needs_no_recovery_or_cannot_be_recovered_is_told(tmp_path):
    write_recording(tmp_path / "g.mcap", 30, ended())
    with pytest.raises(ConfigError, match=r"g\.mcap"):
        recover_file(tmp_path / "g.mcap")
    (tmp_path / "other.mcap").write_bytes(b"t,gap\n")
    with pytest.raises(DataDamaged, match=r"other\.mcap"):
        recover_file(tmp_path / "other.mcap")
    with pytest.raises(ConfigError, match=r"nowhere\.mcap"):
        recover_file(tmp_path / "nowhere.mcap")


def test_a_folder_without_a_store_does_not_become_one(tmp_path):
    for command in ("recover", "verify"):
        assert graspsense(command, tmp_path).returncode == 2
    assert not list(tmp_path.iterdir())


def test_the_commands_say_what_they_did(store):
    keep(store)
    part(store)
    assert answered("verify", store.folder)["unfinished"] == [
        "20261121-103015-0001.mcap.part was never finished"
    ]
    (file,) = answered("recover", store.folder)["files"]
    assert (file["what"], file["trial"]) == ("recovered", 2)
    store.trial(1).recording.unlink()
    done = graspsense("verify", store.folder)
    assert done.returncode == 5
    assert "is missing" in done.stdout
    done = graspsense("replay", f"{store.folder}#1")
    assert done.returncode == 5
    assert "trial 1" in done.stderr
