"""Files are written completely or not at all, whoever else writes to the same name or to the same folder."""

from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import threading
from contextlib import contextmanager
from unittest.mock import patch

import pytest
from cases import every_case
from repository import ROOT

from graspsense.core.files import whole_file
from graspsense.core.files.whole_file import write_whole
from graspsense.core.values.errors import ConfigError, GraspsenseError
from graspsense.recording.atomic_file import SaveFailed, write_new, write_or_replace
from graspsense.recording.writer import RecordingWriter

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


def start_writer(path, letter):
    return subprocess.Popen([sys.executable, "-c", WRITER, str(path), letter, str(BYTES)])


@pytest.mark.slow
def test_a_reader_of_a_file_that_two_processes_write_always_sees_a_whole_one(tmp_path):
    path = tmp_path / "model.json"
    write_whole(path, b"a" * BYTES)
    reads = torn = changes = 0
    shown = b""
    with start_writer(path, "b") as writer, start_writer(path, "c") as other:
        try:
            while reads < READS or changes < 20:
                data = path.read_bytes()
                reads += 1
                torn += len(data) < BYTES or len(set(data)) != 1
                changes += data[:1] != shown
                shown = data[:1]
                assert writer.poll() is other.poll() is None
        finally:
            (tmp_path / "stop").touch()
    assert (writer.returncode, other.returncode, torn) == (0, 0, 0)
    assert entries(tmp_path) == ["model.json", "stop"]


def test_the_mode_is_that_of_a_new_file_less_the_mask_of_the_user(tmp_path):
    for mask, mode in ((0o022, 0o644), (0o002, 0o664), (0o077, 0o600)):
        old_mask = os.umask(mask)
        try:
            write_whole(tmp_path / f"{mask}", b"x")
        finally:
            os.umask(old_mask)
        assert stat.S_IMODE((tmp_path / f"{mask}").stat().st_mode) == mode


@pytest.fixture
def known_token(monkeypatch):
    """Make the next name predictable, which it is not; the second try has another."""
    tokens = iter(["0" * 16, "1" * 16])
    monkeypatch.setattr(whole_file.secrets, "token_hex", lambda n: next(tokens))
    return "0" * 16


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


@pytest.mark.parametrize("kind", ["link", "dangling link", "pipe", "file"])
def test_what_somebody_planted_under_the_passing_name_is_never_written_to(tmp_path, known_token, kind):
    """Not even if the name could be guessed."""
    victim = tmp_path / "victim"
    plant(kind, tmp_path / f"out.csv.{known_token}.part", victim)
    whole_file._SWEPT.add(str(tmp_path))
    with pytest.raises(FileExistsError):
        write_whole(tmp_path / "out.csv", b"new")
    assert not (tmp_path / "out.csv").exists()
    assert victim.exists() == (kind != "dangling link")
    assert kind == "dangling link" or victim.read_text() == "precious"


@every_case("name", ["model.json", "model.json.part", "model.part", "model.new"])
def test_a_name_that_is_a_link_is_replaced_and_its_target_and_other_links_are_kept(tmp_path, name):
    victim = tmp_path / "victim"
    plant("link", tmp_path / name, victim)
    write_or_replace(tmp_path / "model.json", b"{}")
    assert victim.read_text() == "precious"
    assert (tmp_path / name).is_symlink() == (name != "model.json")
    assert (tmp_path / "model.json").read_bytes() == b"{}"


@pytest.mark.parametrize("kind", ["pipe", "device"])
def test_a_device_or_a_pipe_is_refused_and_not_replaced(tmp_path, kind):
    path = tmp_path / "out"
    if kind == "pipe":
        os.mkfifo(path)
    else:
        path.symlink_to(os.devnull)
    with pytest.raises(SaveFailed, match="not a regular file"):
        write_or_replace(path, b"x")
    assert not path.is_file()
    assert entries(tmp_path) == ["out"]


def test_of_many_writers_of_a_new_file_one_succeeds(tmp_path):
    path = tmp_path / "export.csv"
    barrier = threading.Barrier(8)
    results = []

    def write(letter):
        barrier.wait()
        try:
            write_new(path, letter * 1000)
            results.append(letter)
        except ConfigError:
            results.append(None)

    threads = [threading.Thread(target=write, args=(bytes([65 + k]),)) for k in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    (winner,) = [letter for letter in results if letter]
    assert path.read_bytes() == winner * 1000
    assert entries(tmp_path) == ["export.csv"]


def test_a_new_file_on_a_disk_without_hard_links(tmp_path, monkeypatch):
    def refuse(*names):
        raise OSError(errno.EPERM, "no links here")

    monkeypatch.setattr(os, "link", refuse)
    write_new(tmp_path / "a", b"1")
    with pytest.raises(ConfigError):
        write_new(tmp_path / "a", b"2")
    assert (tmp_path / "a").read_bytes() == b"1"
    assert entries(tmp_path) == ["a"]


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


def test_a_link_or_a_pipe_with_the_name_of_a_leftover_does_no_harm(tmp_path):
    victim = tmp_path / "victim"
    for kind in ("link", "pipe"):
        plant(kind, tmp_path / f"{kind}.{'0' * 16}.part", victim)
    whole_file._SWEPT.discard(str(tmp_path))
    write_whole(tmp_path / "c", b"{}")
    assert victim.read_text() == "precious"
    assert (tmp_path / "c").read_bytes() == b"{}"


@contextmanager
def longest_file(size):
    """Let this process write no file longer than so many bytes: a real error of a write."""
    resource = pytest.importorskip("resource")
    import signal

    limits, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, limits[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, handler)


@pytest.mark.parametrize("call", ["write", "fsync", "replace", "open"])
def test_an_error_of_the_disk_leaves_the_old_file_and_nothing_else(tmp_path, call):
    path = tmp_path / "a.json"
    write_or_replace(path, b"old")

    def refuse(*arguments, **options):
        raise OSError(errno.ENOSPC, "No space left on device")

    with (
        longest_file(100) if call == "write" else patch.object(whole_file.os, call, refuse),
        pytest.raises(SaveFailed),
    ):
        write_or_replace(path, b"new" * 1000)
    assert path.read_bytes() == b"old"
    assert entries(tmp_path) == ["a.json"]


def test_a_recording_that_another_writer_finished_meanwhile_is_not_overwritten(tmp_path, monkeypatch):
    path = tmp_path / "g.mcap"
    open_file = os.open

    def finished_first(name, *arguments):
        path.write_bytes(b"of the other writer")
        return open_file(name, *arguments)

    monkeypatch.setattr(os, "open", finished_first)
    with pytest.raises(FileExistsError):
        RecordingWriter(path)
    assert path.read_bytes() == b"of the other writer"
    assert entries(tmp_path) == ["g.mcap"]


@every_case("kind", ["dangling link", "pipe"])
def test_a_recording_is_never_written_through_what_somebody_planted(tmp_path, kind):
    victim = tmp_path / "victim"
    plant(kind, tmp_path / "g.mcap.part", victim)
    with pytest.raises(FileExistsError):
        RecordingWriter(tmp_path / "g.mcap")
    assert not victim.exists() or victim.read_text() == "precious"


def test_pipes_and_links_in_a_store_do_not_stop_recover_and_verify(tmp_path):
    from graspsense.store.recover import recover_file, recover_store
    from graspsense.store.store import Store
    from graspsense.store.verify import verify_store

    with Store.open(tmp_path / "trials") as store:
        for name in ("a.mcap", "b.mcap.part", "c-recovered.mcap.part"):
            os.mkfifo(store.recordings / name)
        (store.recordings / "d.mcap.part").symlink_to(tmp_path / "nowhere")
        assert recover_store(store) == []
        with pytest.raises(GraspsenseError):
            recover_file(store.recordings / "b.mcap.part")
    assert sorted(line.split()[0] for line in verify_store(tmp_path / "trials").unfinished) == [
        "a.mcap", "b.mcap.part", "c-recovered.mcap.part", "d.mcap.part",
    ]  # fmt: skip


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
    from graspsense.experiments.results import LOCK, Results

    results = Results(tmp_path / "out")
    results.folder.mkdir()
    (results.folder / LOCK).symlink_to(tmp_path / "made elsewhere")
    with pytest.raises(SaveFailed), results.alone():
        pass
    assert not (tmp_path / "made elsewhere").exists()
