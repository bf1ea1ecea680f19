"""Files are written completely or not at all, whoever else writes to the same name or to the same folder."""

import errno
import os
import signal
import stat
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from unittest.mock import patch

import pytest
from cases import every_case
from repository import ROOT

from graspsense.core.files import whole_file
from graspsense.core.files.whole_file import SaveFailed, write_new, write_or_replace, write_whole
from graspsense.core.values.errors import ConfigError, GraspsenseError
from graspsense.experiments.results import LOCK, Results
from graspsense.recording.writer import RecordingWriter
from graspsense.store.recover import recover_file, recover_store
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

READS = 500
BYTES = 200_000
WRITER = """
import sys
from pathlib import Path
from graspsense.core.files.whole_file import write_whole
path, letter, length = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
k = 0
while not path.with_name("stop").exists():
    k += 1
    write_whole(path, letter.encode() * (length + k % 1000))
"""


def entries(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.slow
def test_a_reader_of_a_file_that_two_processes_write_always_sees_a_whole_one(tmp_path):
    path = tmp_path / "model.json"
    write_whole(path, b"a" * BYTES)
    reads = torn = changes = 0
    shown = b""
    writers = [subprocess.Popen([sys.executable, "-c", WRITER, path, name, str(BYTES)]) for name in "bc"]
    try:
        while reads < READS or changes < 20:
            data = path.read_bytes()
            reads += 1
            torn += len(data) < BYTES or len(set(data)) != 1
            changes += data[:1] != shown
            shown = data[:1]
            assert [writer.poll() for writer in writers] == [None, None]
    finally:
        (tmp_path / "stop").touch()
        codes = [writer.wait(60.0) for writer in writers]
    assert (codes, torn) == ([0, 0], 0)
    assert entries(tmp_path) == ["model.json", "stop"]


def test_the_mode_is_that_of_a_new_file_less_the_mask_of_the_user(tmp_path):
    for mask, mode in ((0o022, 0o644), (0o002, 0o664), (0o077, 0o600)):
        old_mask = os.umask(mask)
        try:
            write_whole(tmp_path / f"{mask}", b"x")
        finally:
            os.umask(old_mask)
        assert stat.S_IMODE((tmp_path / f"{mask}").stat().st_mode) == mode


def plant(kind, path, victim):
    """Put a link to a file of somebody else, a pipe or a second name of that file in place of a path."""
    if kind != "dangling link":
        victim.write_text("precious")
    if kind == "pipe":
        os.mkfifo(path)
    elif kind == "file":
        os.link(victim, path)
    else:
        path.symlink_to(victim)


def untouched(kind, victim):
    return not victim.exists() if kind == "dangling link" else victim.read_text() == "precious"


@every_case("kind", ["link", "dangling link", "pipe", "file"])
def test_what_somebody_planted_under_the_passing_name_is_never_written_to(tmp_path, monkeypatch, kind):
    """Not even if the name could be guessed."""
    monkeypatch.setattr(whole_file.secrets, "token_hex", lambda n: "0" * 16)
    victim = tmp_path / "victim"
    plant(kind, tmp_path / f"out.csv.{'0' * 16}.part", victim)
    whole_file._SWEPT.add(str(tmp_path))
    with pytest.raises(FileExistsError):
        write_whole(tmp_path / "out.csv", b"new")
    assert not (tmp_path / "out.csv").exists()
    assert untouched(kind, victim)


@every_case("name", ["model.json", "model.json.part", "model.part", "model.new"])
def test_a_name_that_is_a_link_is_replaced_and_its_target_and_other_links_are_kept(tmp_path, name):
    victim = tmp_path / "victim"
    plant("link", tmp_path / name, victim)
    write_or_replace(tmp_path / "model.json", b"{}")
    assert victim.read_text() == "precious"
    assert (tmp_path / name).is_symlink() == (name != "model.json")
    assert (tmp_path / "model.json").read_bytes() == b"{}"


@every_case("kind", ["pipe", "device"])
def test_a_device_or_a_pipe_is_refused_and_not_replaced(tmp_path, kind):
    path = tmp_path / "out"
    os.mkfifo(path) if kind == "pipe" else path.symlink_to(os.devnull)
    with pytest.raises(SaveFailed, match="regular file"):
        write_or_replace(path, b"x")
    assert not path.is_file()
    assert entries(tmp_path) == ["out"]


def test_of_many_writers_of_a_new_file_one_succeeds(tmp_path):
    path, barrier = tmp_path / "export.csv", threading.Barrier(8)

    def write(k):
        barrier.wait()
        try:
            write_new(path, bytes([k]) * 1000)
        except ConfigError:
            return None
        return k

    with ThreadPoolExecutor(8) as threads:
        (winner,) = [k for k in threads.map(write, range(8)) if k is not None]
    assert path.read_bytes() == bytes([winner]) * 1000
    assert entries(tmp_path) == ["export.csv"]


def test_a_new_file_on_a_disk_without_hard_links(tmp_path, monkeypatch):
    monkeypatch.setattr(os, "link", refusing(errno.EPERM))
    write_new(tmp_path / "a", b"1")
    with pytest.raises(ConfigError):
        write_new(tmp_path / "a", b"2")
    assert (tmp_path / "a").read_bytes() == b"1"
    assert entries(tmp_path) == ["a"]


def refusing(number):
    """Return a function of the system that fails with this error."""

    def refuse(*arguments, **options):
        raise OSError(number, os.strerror(number))

    return refuse


KILLED = """
import os, signal, sys
from pathlib import Path
from graspsense.core.files import whole_file
whole_file.os.replace = lambda *names: os.kill(os.getpid(), signal.SIGKILL)
whole_file.write_whole(Path(sys.argv[1]), b"x" * 1000)
"""


def test_what_a_killed_writer_left_is_deleted_by_the_next_and_a_living_one_is_left_alone(tmp_path):
    subprocess.run([sys.executable, "-c", KILLED, str(tmp_path / "a.json")], check=False)
    (leftover,) = entries(tmp_path)
    assert leftover.startswith("a.json.")
    assert leftover.endswith(".part")
    living, fd = whole_file._new_part(tmp_path / "b.json", 0o644)
    for name in ("mine.part", "g.mcap.part", "x.0123.part"):
        (tmp_path / name).write_text("not ours")
    whole_file._SWEPT.discard(str(tmp_path))

    write_whole(tmp_path / "c.json", b"{}")

    assert entries(tmp_path) == sorted([living.name, "c.json", "mine.part", "g.mcap.part", "x.0123.part"])
    os.close(fd)


@every_case("kind", ["link", "pipe"])
def test_a_link_or_a_pipe_with_the_name_of_a_leftover_does_no_harm(tmp_path, kind):
    victim = tmp_path / "victim"
    plant(kind, tmp_path / f"{kind}.{'0' * 16}.part", victim)
    whole_file._SWEPT.discard(str(tmp_path))
    write_whole(tmp_path / "c", b"{}")
    assert untouched(kind, victim)
    assert (tmp_path / "c").read_bytes() == b"{}"


@contextmanager
def longest_file(size):
    """Let this process write no file longer than so many bytes: a real error of a write."""
    resource = pytest.importorskip("resource")
    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)


@every_case("call", ["write", "fsync", "replace", "open"])
def test_an_error_of_the_disk_leaves_the_old_file_and_nothing_else(tmp_path, call):
    path = tmp_path / "a.json"
    write_or_replace(path, b"old")
    full = patch.object(whole_file.os, call, refusing(errno.ENOSPC))
    with longest_file(100) if call == "write" else full, pytest.raises(SaveFailed):
        write_or_replace(path, b"new" * 1000)
    assert path.read_bytes() == b"old"
    assert entries(tmp_path) == ["a.json"]


def test_a_recording_that_another_writer_finished_meanwhile_is_not_overwritten(tmp_path, monkeypatch):
    path = tmp_path / "g.mcap"
    open_file = os.open
    # Before ours is opened, the other one is finished.
    monkeypatch.setattr(os, "open", lambda *given: path.write_bytes(b"of the other") and open_file(*given))
    with pytest.raises(FileExistsError):
        RecordingWriter(path)
    assert path.read_bytes() == b"of the other"
    assert entries(tmp_path) == ["g.mcap"]


@every_case("kind", ["dangling link", "pipe"])
def test_a_recording_is_never_written_through_what_somebody_planted(tmp_path, kind):
    victim = tmp_path / "victim"
    plant(kind, tmp_path / "g.mcap.part", victim)
    with pytest.raises(FileExistsError):
        RecordingWriter(tmp_path / "g.mcap")
    assert untouched(kind, victim)


def test_pipes_and_links_in_a_store_do_not_stop_recover_and_verify(tmp_path):
    pipes = ["a.mcap", "b.mcap.part", "c-recovered.mcap.part"]
    with Store.open(tmp_path / "trials") as store:
        for name in pipes:
            os.mkfifo(store.recordings / name)
        (store.recordings / "d.mcap.part").symlink_to(tmp_path / "nowhere")
        assert recover_store(store) == []
        with pytest.raises(GraspsenseError):
            recover_file(store.recordings / "b.mcap.part")
    unfinished = verify_store(tmp_path / "trials").unfinished
    assert sorted(line.split()[0] for line in unfinished) == [*pipes, "d.mcap.part"]


def test_all_of_the_code_replaces_files_in_one_place():
    """A second place would be a second rule: only recordings, which have an owner each, are renamed elsewhere."""
    sources = [*ROOT.glob("src/**/*.py"), *ROOT.glob("plugins/*/src/**/*.py")]
    writers = {
        path.relative_to(ROOT).as_posix()
        for path in sources
        if any(word in path.read_text() for word in ("os.replace(", "os.rename(", ".savefig(path"))
    }
    assert len(sources) > 200
    assert writers == {"src/graspsense/core/files/whole_file.py", "src/graspsense/recording/writer.py"}


def test_a_link_in_place_of_the_lock_of_an_experiment_is_not_followed(tmp_path):
    results = Results(tmp_path / "out")
    results.folder.mkdir()
    (results.folder / LOCK).symlink_to(tmp_path / "made elsewhere")
    with pytest.raises(SaveFailed), results.alone():
        pass
    assert not (tmp_path / "made elsewhere").exists()
