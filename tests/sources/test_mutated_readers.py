"""Files of every format that is read, changed in what they contain: an answer, or an error of ours with their name.

Beside each changed file is a good one, which must be read. The changes of a file follow from its format and its number
alone, so that one that fails can be made again: `GRASPSENSE_MUTATED=npz:137`. `GRASPSENSE_MUTATIONS` is the number of
files of each format in the slow run.
"""

from __future__ import annotations

import json
import os
import random
import shutil
import warnings
from collections.abc import Callable
from pathlib import Path

import mutated_files as change
import pytest
import recorded_files as write
from attrs import frozen

from graspsense.core.components.registry import installed
from graspsense.core.files.whole_file import SaveFailed
from graspsense.core.settings.layers import Flag
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import GraspsenseError
from graspsense.experiments.experiment_file import read_experiment
from graspsense.recording.export_trace import declared_beside
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.layout import TICK_FIELDS
from graspsense.sources.importing.import_recording import import_recording
from graspsense.sources.importing.import_sources import recordings_to_import
from graspsense.sources.importing.import_summary import summary_of
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.recordings.dataset_recordings import handed_over
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.sources.recordings.grasp_csv import read_squeeze
from graspsense.sources.recordings.noise_thresholds import thresholds_for
from graspsense.sources.trial_source import load_trials
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense.store.imported_contents import AlreadyImported, ImportedContents
from graspsense.store.store import Store
from graspsense_c45.arff import ArffError, read_arff
from graspsense_sim_gripper.scene.library import find

QUICK = 1
SLOW = int(os.environ.get("GRASPSENSE_MUTATIONS", "0")) or 40
SLOWER = min(SLOW, 14)
"""Files of a format that takes long to open."""
IMPORTED_OF = 4
"""One of so many of the recordings that can be read is imported as well."""
TEXT_WORK_S = 20
"""Seconds of the processor that reading a text of some lines may take."""


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


def error_of(read, file, *limits):
    """Return what an error of ours says of this file, empty if it is read. Any other error is raised with a note."""
    try:
        with change.bounded(*limits):
            read()
    except (GraspsenseError, ArffError) as error:
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
    assert recordings[0].labelled.source == good
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


# Texts. Each has a reader; one of its files is changed, and an error names one of them.

ROWS = "".join(f"{k * 0.01:.2f},{60 - k},{max(0, k - 5)},jar\n" for k in range(12))
GRASP = "t,g,F,kind\n" + ROWS
FEATURES = "label,instance,p_first [m],force\n" + "".join(
    f"{'ab'[k % 2]},i{k % 4},{k % 5}.5,{k % 3}\n" for k in range(12)
)
MANIFEST = """files = "*.csv"
time = "t"
gap = "g [mm]"
force = "max(F, 2*F - first(F))"
zero = "2 samples"
resample_hz = 50.0
label = "{kind}"
channels = { twice = "F*2 [counts]" }
values = { peak = "peak(F) [N]" }
"""
STARTED = """files = ["{name}.csv"]
start = "grasp (?P<label>[a-z]+) (?P<order>[0-9]+)"
time = ["s", "t"]
gap = "0.06 - 0.001*abs(g)"
left = "F"
right = "norm('F', g)"
rate_hz = 100
"""
LIST = "file,label,first_row,last_row,order\ngrasp.csv,jar:full,1,9,3\ngrasp.csv,can,2,12,4\n"
BY_LIST = 'list = "list.txt"\ntime = "t"\ngap = "g [mm]"\nforce = "F"\n'
ARFF = "@relation grasps\n@attribute width numeric\n@attribute 'soft one' {yes, no}\n@attribute label {a, b}\n@data\n"
ARFF += "0.1, yes, a\n0.2, ?, b\n{0 0.3, 2 b}, {2}\n"
PIPELINE = 'extends = "default"\n[controller]\ntype = "hybrid"\nprobing_force_n = 15.0\n[run]\nseed = 3\n'
EXPERIMENT = """title = "forces"
seeds = [1, 2]
classifiers = ["tree", { type = "forest", trees = 5 }]
[controller]
probing_force_n = 15.0
[sweep]
"controller.closing_speed_m_s" = [0.01, 0.02]
[data]
instances = 2
trials = 2
total = 20
[judge]
folds = 2
grasps = 1
"""
SCENE = 'width_m = 0.06\nmass_kg = 0.1\nsummary = "cup"\n[[terms]]\ntype = "maxwell"\nk_n_m = 900.0\ntau_s = 0.2\n'
DECLARED = json.dumps(
    {
        "channels": [],
        "tables": [],
        "cells": 22,
        "device": "x",
        "units": {},
        "rate_hz": 100.0,
        "has_release": True,
    }
)
TICKS = ",".join(TICK_FIELDS) + "\n"
TICKS += "".join(f"{k * 0.01:.2f}" + ",1" * (len(TICK_FIELDS) - 1) + "\n" for k in range(6))


def read_manifest(folder, rng):
    for recording in read_recordings(str(folder / "manifest.toml")):
        if isinstance(recording, UnreadableRecording):
            told = f"{recording.source} {recording.error}"
            assert isinstance(recording.error, GraspsenseError)
            assert any(name in told for name in ("manifest", "grasp", "list.txt"))


def read_grasp(folder, rng):
    read_squeeze(f"{folder}/grasp.csv?time=t&gap=g*0.001&force=F")


def read_features(folder, rng):
    read_labelled(folder / "features.csv", "label", instance=rng.choice((None, "instance")))


TEXTS = {
    "manifest": ({"manifest.toml": MANIFEST, "grasp.csv": GRASP}, read_manifest),
    "start": (
        {"manifest.toml": STARTED, "grasp.csv": f"grasp jar 1\n{GRASP}grasp can 2\n{GRASP}"},
        read_manifest,
    ),
    "list": ({"manifest.toml": BY_LIST, "list.txt": LIST, "grasp.csv": GRASP}, read_manifest),
    "grasp": ({"grasp.csv": GRASP}, read_grasp),
    "features": ({"features.csv": FEATURES}, read_features),
    "exported": (
        {"grasp.csv": TICKS, declared_beside(Path("grasp.csv")).name: DECLARED},
        lambda folder, rng: read_exported(str(folder / "grasp.csv")),
    ),
    "arff": ({"grasps.arff": ARFF}, lambda folder, rng: read_arff(folder / "grasps.arff")),
    "pipeline": ({"pipeline.toml": PIPELINE}, lambda folder, rng: resolve(str(folder / "pipeline.toml"))),
    "experiment": ({"e.toml": EXPERIMENT}, lambda folder, rng: read_experiment(str(folder / "e.toml"))),
    "scene": ({"scene.toml": SCENE}, lambda folder, rng: find(str(folder / "scene.toml"))),
}


@pytest.mark.parametrize(
    "count",
    [QUICK, pytest.param(5 * SLOW, marks=pytest.mark.slow), pytest.param(400, marks=pytest.mark.long)],
)
@pytest.mark.parametrize("name", TEXTS)
def test_texts(name, count, tmp_path):
    files, read = TEXTS[name]
    for number in numbers(name, count):
        rng = random.Random(f"{name}:{number}")
        one_changed = rng.choice(sorted(files))
        for file, text in files.items():
            (tmp_path / file).write_bytes(change.text_of(text, rng) if file == one_changed else text.encode())
        told = error_of(lambda rng=rng: read(tmp_path, rng), f"{name}:{number}", TEXT_WORK_S, "error")
        assert not told or str(tmp_path) in told or any(file in told for file in files), told[:200]
        assert len(told) < 100_000


@pytest.mark.parametrize("count", [QUICK, pytest.param(SLOW, marks=pytest.mark.slow)])
def test_icub_files(count, tmp_path):
    for number in numbers("icub", count):
        for k in (1, 2):
            write.icub(tmp_path / f"can_{k}.txt")
        change.text_file(tmp_path / "can_2.txt", random.Random(f"icub:{number}"))
        with change.bounded():
            assert "can" in load_trials(f"icub:{tmp_path}").labels
            recordings, unreadable = recordings_to_import([f"icub:{tmp_path}"], {}, None)
        assert len(recordings) + len(unreadable) == 2
