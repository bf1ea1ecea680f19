"""Faults of the machine are told as such: a disk that cannot be read is not damaged data, and no date is too late."""

import errno
import itertools
import os
import struct
import time
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from cases import every_case
from commands import graspsense, refused
from kept import keep, write_recording

from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.grasp.calibration_files import (
    Calibration,
    calibrations_of,
    read_calibration,
    write_calibration,
)
from graspsense.core.values.errors import ConfigError, DataDamaged
from graspsense.recording.reader import read_recorded
from graspsense.store.opening import refuse_read_fault
from graspsense.store.recover import recover_store
from graspsense.store.store import Store
from graspsense.store.time_recorded import order_recorded
from graspsense.store.verify import verify_store

UNREADABLE = Path("/proc/self/mem")
"""A file whose reading fails with EIO, since nothing is at the address 0 of a process."""

needs_proc = pytest.mark.skipif(not UNREADABLE.exists(), reason="needs /proc, for a file whose reading fails")


@pytest.fixture
def failing(tmp_path):
    """Return a store whose first recording is on a disk that fails."""
    with Store.open(tmp_path / "t") as store:
        for _ in range(3):
            keep(store)
        path = store.recording_path(store.summary(1).recording)
    path.rename(tmp_path / "whole.mcap")
    path.symlink_to(UNREADABLE)
    with pytest.raises(OSError, match=os.strerror(errno.EIO)):
        path.read_bytes()
    return tmp_path / "t"


@needs_proc
def test_verify_tells_a_disk_that_fails_from_damage(failing):
    findings = verify_store(failing)
    assert findings.problems == ()
    assert [line.partition(":")[0] for line in findings.unread] == ["trial 1"]
    assert not findings.as_json()["intact"]
    done = graspsense("verify", str(failing))
    assert done.returncode == 2
    said = done.stdout
    assert "not read" in said
    assert "disk" in said
    assert "0 damaged" in said


@needs_proc
@every_case(
    "command", [("replay", "{}#1"), ("export", "{}#1", "--to", "{}.csv"), ("verify", "{}/recordings/{name}")]
)
def test_a_recording_on_a_disk_that_fails_is_neither_lost_nor_damaged(failing, command):
    (name,) = [path.name for path in (failing / "recordings").iterdir() if path.is_symlink()]
    err = refused(*[word.format(failing, name=name) for word in command])
    said = err
    assert os.strerror(errno.EIO) in said
    assert "lost" not in said
    assert "damaged" not in said


@needs_proc
def test_a_calibration_on_a_disk_that_fails_is_not_damaged(tmp_path):
    (tmp_path / "tare.json").symlink_to(UNREADABLE)
    with pytest.raises(ConfigError, match=os.strerror(errno.EIO)):
        read_calibration(tmp_path / "tare.json")


def test_a_page_of_the_database_that_the_disk_does_not_deliver_is_no_damage():
    # What PRAGMA integrity_check lists of a page whose reading failed: 266 is SQLITE_IOERR_READ, 11 is SQLITE_CORRUPT.
    with pytest.raises(SaveFailed, match="disk"):
        refuse_read_fault(Path("t"), "Tree 4 page 7: unable to get the page. error code=266")
    refuse_read_fault(Path("t"), "Tree 4 page 7: unable to get the page. error code=11")
    refuse_read_fault(Path("t"), "row 3 missing from index trial_label")


def malformed(folder):
    """Overwrite one page of the tables of a store."""
    path = folder / "store.sqlite"
    data = bytearray(path.read_bytes())
    page = int.from_bytes(data[16:18], "big")
    for number in range(1, len(data) // page):
        changed = bytearray(data)
        changed[number * page : (number + 1) * page] = b"\xa5" * page
        path.write_bytes(changed)
        yield number
    path.write_bytes(data)


def test_recover_says_that_the_database_is_malformed_and_touches_nothing(tmp_path):
    with Store.open(tmp_path / "t") as store:
        for _ in range(3):
            keep(store)
        unfinished = store.recordings / "20261121-103015-0001.mcap"
        write_recording(unfinished, 200, finish=False)._out.close()
    part = unfinished.with_name(unfinished.name + ".part")
    codes = set()
    for page in malformed(tmp_path / "t"):
        code, _, said = graspsense("recover", str(tmp_path / "t"))
        codes.add(code)
        assert "damaged" in said, page
        assert "internal error" not in said
        assert part.exists()
    assert codes == {5}
    assert graspsense("recover", str(tmp_path / "t")).returncode == 0
    assert not part.exists()


@every_case("year", [2262, 2300, 2500, 2600])
def test_a_grasp_recorded_in_any_year_is_read_and_recovered(tmp_path, monkeypatch, year):
    now_ns = int(datetime(year, 6, 1, tzinfo=UTC).timestamp()) * 10**9
    ticks = itertools.count(now_ns, 1_000_000)
    monkeypatch.setattr(time, "time_ns", lambda: next(ticks))
    with Store.open(tmp_path / "t") as store:
        keep(store, ticks=150)
        write_recording(store.recordings / "late.mcap", 150, finish=False)._out.close()
        recoveries = recover_store(store)
        assert [recovered.what for recovered in recoveries] == ["recovered"]
        assert sorted(len(read_recorded(path)) for path in store.recordings.glob("*.mcap"))[1] == 150
    assert verify_store(tmp_path / "t").problems == ()


def test_pictures_of_a_late_grasp_are_exported():
    from graspsense.recording.foxglove import raw_image_message

    picture = np.zeros((2, 3), dtype="uint8")
    late = raw_image_message(2**63 + 5, "pads", picture)
    assert struct.unpack_from("<iI", late, 4) == (2**31 - 1, (2**63 + 5) % 10**9)
    assert struct.unpack_from("<iI", raw_image_message(3_000_000_007, "pads", picture), 4) == (3, 7)


def test_an_mcap_file_of_another_program_can_be_of_any_year(tmp_path):
    pytest.importorskip("rosbags")
    from mcap.writer import Writer

    from graspsense.sources.formats.ros_format import read_bag

    def file(times):
        path = tmp_path / f"{times[-1]}.mcap"
        with path.open("wb") as out:
            writer = Writer(out)
            writer.start()
            schema = writer.register_schema("std_msgs/msg/Float64", "ros2msg", b"float64 data\n")
            for k, topic in enumerate(("/gap", "/force")):
                channel = writer.register_channel(topic, "cdr", schema)
                for i, t_ns in enumerate(times):
                    writer.add_message(channel, t_ns, b"\0\1\0\0" + struct.pack("<d", i + k), t_ns)
            writer.finish()
        return path

    late = 2**63 + 10**18
    (table,) = read_bag(file([late + k * 10**9 for k in range(5)]))
    assert table.t_s.tolist() == [float(late + k * 10**9) * 1e-9 for k in range(5)]
    assert table.numbers["/force.data"].tolist() == [1.0, 2.0, 3.0, 4.0, 5.0]
    with pytest.raises(DataDamaged, match="292 years"):
        read_bag(file([0, 2**63 + 1, 2**64 - 1]))


def test_times_at_the_ends_of_the_calendar_have_an_order_or_none():
    late = ["9999-12-31T23:59:59-23:59", "2262-04-12T00:00:00+00:00", "0001-01-01T00:00:00+23:59"]
    labels = [{"recorded_at": text} for text in late]
    order, why = order_recorded(["x"] * 3, ["import"] * 3, labels)
    assert order == (2, 1, 0) or (order is None and "recorded_at" in why)


def test_a_folder_of_calibrations_is_found_below_the_home_and_told_where_it_is_not_there(
    tmp_path, monkeypatch
):
    for folder in ("", "none", tmp_path):
        assert calibrations_of(folder, "NONE", {}) == {}
    with pytest.raises(ConfigError, match=r"gripper\.calibration.*mistyped"):
        calibrations_of(tmp_path / "mistyped", "NONE", {})
    monkeypatch.setenv("HOME", str(tmp_path))
    data = {"left": [1.0, 2.0], "right": [1.0, 2.0]}
    tare = Calibration(kind="tare", serial="L7", device={}, made="2300-01-01T00:00:00", data=data)
    write_calibration(tmp_path / "mine" / "L7" / "tare.json", tare)
    assert calibrations_of("~/mine", "L7", {})["tare"].data == data
