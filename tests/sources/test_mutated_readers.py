"""Files of every format that is read, changed in what they contain: an answer, or an error of ours with their name.

Beside each changed file is a good one, which must be read. The changes of a file follow from its format and its number
alone, so that one that fails can be made again: `GRASPSENSE_MUTATED=npz:137`. `GRASPSENSE_MUTATIONS` is the number of
files of each format in the slow run.
"""

from __future__ import annotations

import os
import random
import resource
import shutil
import signal
import warnings
from collections.abc import Callable
from contextlib import contextmanager
from pathlib import Path

import mutated_files as change
import pytest
import recorded_files as write
from attrs import frozen

from graspsense.core.components.registry import installed
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import GraspsenseError
from graspsense.recording.atomic_file import SaveFailed
from graspsense.sources.importing.import_recording import import_recording
from graspsense.sources.importing.import_sources import recordings_to_import
from graspsense.sources.importing.import_summary import summary_of
from graspsense.sources.recordings.dataset_recordings import handed_over
from graspsense.sources.recordings.noise_thresholds import thresholds_for
from graspsense.sources.trial_source import load_trials
from graspsense.store.imported_contents import AlreadyImported, ImportedContents
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

QUICK = 1
SLOW = int(os.environ.get("GRASPSENSE_MUTATIONS", "0")) or 40
SLOWER = min(SLOW, 14)
"""Files of a format that takes long to open."""
IMPORTED_OF = 4
"""One of so many of the recordings that can be read is imported as well."""
MEMORY = 1_500_000_000
"""Bytes that reading may take beside what the process has."""
WORK_S = 60
"""Seconds of the processor after which a reader is taken for one that does not end."""


@frozen
class Format:
    """How a file is written and changed, its name, and the manifest that reads it; without one it is read alone."""

    write: Callable[[Path], None]
    change: Callable[[Path, random.Random], None]
    ending: str
    manifest: str = ""
    prefix: str = ""
    many: int = SLOW


ARRAY = 'files = "{{label}}_{{order:d}}.npy"\ntime = "c1"\ngap = "c2"\nforce = "c3"\n'
FORMATS = {
    "npz": Format(write.npz, change.npz_file, ".npz", write.MANIFEST),
    "npy": Format(write.npy, change.npy_file, ".npy", ARRAY),
    "mat": Format(write.mat, change.mat_file, ".mat", write.MANIFEST),
    "plain mat": Format(write.plain_mat, change.mat_file, ".mat", write.MANIFEST),
    "parquet": Format(write.parquet, change.parquet_file, ".parquet", write.MANIFEST),
    "csv": Format(write.text, change.text_file, ".csv", write.TEXT_MANIFEST),
    "ros mcap": Format(write.ros_mcap, change.mcap_file, ".mcap", write.ROS_MANIFEST, many=SLOWER),
    "ros1": Format(write.ros1_bag, change.bag_file, ".bag", write.ROS_MANIFEST, many=SLOWER),
    "ros2": Format(write.ros2_bag, change.ros2_folder, "", write.ROS_MANIFEST, many=SLOWER),
    "ros2 mcap": Format(write.ros2_mcap_bag, change.ros2_folder, "", write.ROS_MANIFEST, many=SLOWER),
    "mcap": Format(write.our_mcap, change.mcap_file, ".mcap"),
    "exported npz": Format(write.exported_npz, change.npz_file, ".npz"),
    "exported csv": Format(write.exported_csv, change.text_file, ".csv", prefix="csv:"),
    "exported parquet": Format(write.exported_parquet, change.parquet_file, ".parquet"),
    "pr2 bag": Format(write.pr2_bag, change.bag_file, ".bag", many=SLOWER),
}  # fmt: skip


class DoesNotEndError(BaseException):
    """A reader works longer than any file needs; not an Exception, so that no reader takes it for a damaged file."""


@contextmanager
def bounded():
    """Limit memory and work of what runs here."""

    def stop(number, frame):
        raise DoesNotEndError

    used = int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize()
    soft, hard = resource.getrlimit(resource.RLIMIT_AS)
    handler = signal.signal(signal.SIGVTALRM, stop)
    resource.setrlimit(resource.RLIMIT_AS, (used + MEMORY, hard))
    signal.setitimer(signal.ITIMER_VIRTUAL, WORK_S)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0)
        signal.signal(signal.SIGVTALRM, handler)
        resource.setrlimit(resource.RLIMIT_AS, (soft, hard))


def error_of(read, file):
    """Return what an error of ours says of this file, empty if it is read. Any other error is raised with a note."""
    try:
        with bounded():
            read()
    except GraspsenseError as error:
        return str(error)
    except BaseException as error:
        error.add_note(f"it is made again by GRASPSENSE_MUTATED={file}")
        raise
    return ""


def copied(source, target):
    (shutil.copytree if source.is_dir() else shutil.copyfile)(source, target)


def import_into(folder, recordings):
    """Import recordings as the command does; each is a trial, or an error of ours."""
    summary_of([recording.labelled for recording in recordings])
    thresholds_for([recording.labelled.recording for recording in recordings], {})
    with Store.open(folder) as store:
        contents = ImportedContents(store)
        for recording in recordings:
            flags = (Flag("", "gripper.type", "replay"), Flag("", "gripper.recording", recording.name))
            settings = resolve("default", options=("classifier.type=none",), flags=flags)
            with handed_over(recording.name, recording.labelled.recording):
                try:
                    import_recording(store, settings, installed(), recording.labelled, contents)
                except AlreadyImported:
                    pass
                except SaveFailed:
                    raise
                except GraspsenseError:
                    pass  # an import tells of it


def read_set(folder, fmt, imported):
    """Read a set of a good file and a changed one by its manifest."""
    trials = load_trials(f"manifest:{folder / 'manifest.toml'}")
    left_out = [note for note in trials.notes if "cannot be read" in note]
    # The changed file may still hold the same grasp: then one of them is left out as a copy.
    copies = any("another label" in note for note in trials.notes)
    assert "good" in trials.labels or copies
    assert "bad" in trials.labels or copies or any("bad_2" in note for note in left_out)
    if imported:
        recordings, unreadable = recordings_to_import([str(folder / "manifest.toml")], {}, None)
        assert all("bad_2" in damage.line for damage in unreadable)
        import_into(folder / "trials", recordings)


def read_alone(folder, fmt, imported):
    """Read a good file and a changed one that are named each."""
    good, bad = (f"{fmt.prefix}{folder / name}{fmt.ending}" for name in ("good_1", "bad_2"))
    recordings, unreadable = recordings_to_import([good, bad], {}, "can:full")
    assert recordings[0].source == good
    assert all("bad_2" in damage.line for damage in unreadable)
    if imported:
        import_into(folder / "trials", recordings)


def check(name, number, pattern, folder):
    """Change the file of this format and number, and read it beside a good one."""
    fmt = FORMATS[name]
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir()
    for file in pattern.iterdir():
        copied(file, folder / file.name)
        if file.name.startswith("good_1"):
            copied(file, folder / file.name.replace("good_1", "bad_2"))
    rng = random.Random(f"{name}:{number}")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        fmt.change(folder / f"bad_2{fmt.ending}", rng)
    read = read_set if fmt.manifest else read_alone
    told = error_of(lambda: read(folder, fmt, number % IMPORTED_OF == 0), f"{name}:{number}")
    assert not told, "the good file beside it must be read"


def pattern_of(name, folder):
    folder.mkdir()
    fmt = FORMATS[name]
    fmt.write(folder / f"good_1{fmt.ending}")
    (folder / "exported.mcap").unlink(missing_ok=True)
    if fmt.manifest:
        (folder / "manifest.toml").write_text(
            fmt.manifest.format(
                ending=fmt.ending.removeprefix(".") if fmt.manifest is not write.ROS_MANIFEST else fmt.ending
            )
        )
    return folder


def numbers(name, count):
    wanted, _, number = os.environ.get("GRASPSENSE_MUTATED", "").partition(":")
    return range(count) if not wanted else [int(number)] if wanted == name else []


@pytest.mark.slow
@pytest.mark.parametrize("name", FORMATS)
def test_many_of_each_format(name, tmp_path):
    pattern = pattern_of(name, tmp_path / "pattern")
    for number in numbers(name, FORMATS[name].many):
        check(name, number, pattern, tmp_path / "set")


def check_store(number, pattern, folder):
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(pattern, folder)
    rng = random.Random(f"store:{number}")
    if rng.random() < 0.3:
        change.mcap_file(rng.choice(sorted((folder / "recordings").iterdir())), rng)
    else:
        change.sqlite_file(folder / "store.sqlite", rng)
    for read in (
        lambda: verify_store(folder),
        lambda: load_trials(f"store:{folder}"),
        lambda: load_trials(f"store:{folder}", options=["features.force=left"]),
    ):
        told = error_of(read, f"store:{number}")
        assert not told or str(folder) in told


@pytest.mark.parametrize("count", [QUICK, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_stores(count, tmp_path):
    write.store(tmp_path / "pattern")
    for number in numbers("store", count):
        check_store(number, tmp_path / "pattern", tmp_path / "set")


@pytest.mark.parametrize("count", [QUICK, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_manifests_and_lists(count, tmp_path):
    for number in numbers("manifest", count):
        rng = random.Random(f"manifest:{number}")
        folder = tmp_path / "set"
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir()
        for name in ("good_1.csv", "good_2.csv"):
            write.text(folder / name)
        (folder / "list.csv").write_text("file,label,order\ngood_1.csv,a,1\ngood_2.csv,b,2\n")
        text = write.TEXT_MANIFEST.format(ending="csv")
        if number % 2:
            text = text.replace('files = "{label}_{order:d}.csv"', 'list = "list.csv"')
        (folder / "manifest.toml").write_text(text)
        change.text_file(folder / ("list.csv" if number % 4 == 1 else "manifest.toml"), rng)
        place = f"manifest:{folder / 'manifest.toml'}"
        told = error_of(lambda place=place: load_trials(place), f"manifest:{number}")
        assert not told or str(folder) in told or "good_" in told


@pytest.mark.parametrize("count", [QUICK, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_icub_files(count, tmp_path):
    for number in numbers("icub", count):
        for k in (1, 2):
            write.icub(tmp_path / f"can_{k}.txt")
        change.text_file(tmp_path / "can_2.txt", random.Random(f"icub:{number}"))
        with bounded():
            assert "can" in load_trials(f"icub:{tmp_path}").labels
            recordings, unreadable = recordings_to_import([f"icub:{tmp_path}"], {}, None)
        assert len(recordings) + len(unreadable) == 2
