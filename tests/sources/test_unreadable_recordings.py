"""One recording that cannot be read does not stop the others of its set, whatever its reader raises."""

import errno
import json
import os
import re
import struct
import zipfile
from types import SimpleNamespace

import numpy as np
import pytest
from attrs import evolve
from cases import every_case
from commands import graspsense, printed
from kept import ended, frame, keep, write_recording

from graspsense.core.components.registry.plugins import STRICT_VARIABLE
from graspsense.core.values.errors import ComponentFailed, ConfigError, DataDamaged, TooLarge
from graspsense.core.values.signals import EFFORT, NO_PADS, Reading
from graspsense.recording.export_trace import write_npz
from graspsense.recording.labelled_recording import LabelledRecording, UnreadableRecording
from graspsense.recording.layout import RESULT, START, TICK
from graspsense.recording.readable import each_readable, readable
from graspsense.recording.reader import read_recorded
from graspsense.recording.replayable import Recording
from graspsense.recording.writer import RecordingWriter
from graspsense.sources.recordings.dataset_recordings import readable_or_not
from graspsense.sources.recordings.replay import read_named
from graspsense.sources.trial_source import load_trials
from graspsense.store.store import Store
from graspsense.store.verify import verify_store

N = 60
T_S = np.arange(N) * 0.01
GAP_MM = 60.0 - 10.0 * np.minimum(T_S, 0.4) / 0.4
FORCE_N = np.where(GAP_MM < 55.0, 55.0 - GAP_MM, 0.0)
MANIFEST = 'files = "{label}_{order:d}.npz"\ntime = "t"\ngap = "gap [mm]"\nforce = "f"\n'


def squeeze(path, scale=1.0):
    np.savez_compressed(path, t=T_S, gap=GAP_MM, f=scale * FORCE_N)


@pytest.fixture
def folder(tmp_path):
    return filled(tmp_path)


def filled(folder):
    """A set of six squeezes of two labels in NPZ files, with its manifest."""
    for k in range(6):
        squeeze(folder / f"{'can' if k % 2 else 'jar'}_{k + 1}.npz", 1.0 + 0.1 * k)
    (folder / "manifest.toml").write_text(MANIFEST)
    return folder


def flipped_in_the_middle(path):
    data = bytearray(path.read_bytes())
    with zipfile.ZipFile(path) as archive:
        info = archive.infolist()[0]
    offset = info.header_offset + 30 + len(info.filename) + 60
    data[offset : offset + 8] = b"\xff" * 8
    path.write_bytes(data)


def with_header(path, header):
    """Give the first array of an NPZ file this header."""
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    text = header.encode().ljust(117) + b"\n"
    member = next(iter(members))
    members[member] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(text)) + text + members[member][128:]
    with zipfile.ZipFile(path, "w") as archive:
        for name, content in members.items():
            archive.writestr(name, content)


def from_a_bad_disk(path):
    """Reading the memory of a process at the address 0 gives the error of a bad sector."""
    path.unlink()
    path.symlink_to("/proc/self/mem")


def as_a_pipe(path):
    path.unlink()
    os.mkfifo(path)


SPOIL = {
    "zlib": flipped_in_the_middle,
    "tokenizer": lambda path: with_header(path, "{'descr': '<f8', 'shape': ((((((60,)"),
    "overflow": lambda path: with_header(
        path, f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({10**40},), }}"
    ),
    "recursion": lambda path: with_header(path, "(" * 100 + ")" * 100),
    "empty": lambda path: path.write_bytes(b""),
    "huge": lambda path: np.savez_compressed(path, t=T_S, gap=GAP_MM, f=FORCE_N * 1e306),
    "nothing": lambda path: np.savez_compressed(path, t=T_S[:0], gap=GAP_MM[:0], f=FORCE_N[:0]),
    "texts": lambda path: np.savez_compressed(path, t=T_S.astype(str), gap=GAP_MM, f=FORCE_N),
    "complex": lambda path: np.savez_compressed(path, t=T_S * 1j, gap=GAP_MM, f=FORCE_N),
    "disk": from_a_bad_disk,
    "pipe": as_a_pipe,
}


@pytest.mark.slow
@every_case("kind", SPOIL)
def test_of_a_manifest(tmp_path, kind):
    folder = filled(tmp_path)
    spoilt = folder / "can_2.npz"
    SPOIL[kind](spoilt)
    readings = list(readable_or_not("manifest", str(folder / "manifest.toml")))
    (bad,) = (recording for recording in readings if isinstance(recording, UnreadableRecording))
    assert len(readings) == 6
    assert "can_2.npz" in bad.line
    if kind == "disk":
        assert "disk" in bad.line
        assert not isinstance(bad.error, DataDamaged)


@pytest.mark.parametrize(
    "kind", ["zlib", *(pytest.param(kind, marks=pytest.mark.slow) for kind in ("huge", "disk"))]
)
def test_the_others_of_a_manifest_are_imported_and_loaded(folder, kind):
    SPOIL[kind](folder / "can_2.npz")
    code, out, err = graspsense("import", folder / "manifest.toml", "--save", folder / "trials", "--json")
    assert code == 5, err
    told = json.loads(out)
    assert ["can_2.npz" in line for line in told["unreadable"]] == [True]
    assert len(told["trials"]) == 5
    trials = load_trials(f"manifest:{folder / 'manifest.toml'}")
    assert len(trials) == 5
    assert any(re.search(r"1 of 6 recordings.*read.*can_2\.npz", note) for note in trials.notes)


def test_an_absolute_path_and_one_outside_are_read_and_a_wrong_row_is_of_its_own(folder):
    (folder / "set").mkdir()
    (folder / "set" / "here.npz").write_bytes((folder / "can_2.npz").read_bytes())
    rows = [
        f"{folder / 'can_2.npz'},a,,",
        "../can_4.npz,b,,",
        "here.npz,c,,",
        "missing.npz,d,,",
        "/dev/zero,e,,",
        "here.npz,f,2,1",
        f"here.npz,g,1,{10**30}",
        "here.npz,h,1,50",
    ]
    (folder / "set" / "list.csv").write_text("file,label,first_row,last_row\n" + "\n".join(rows) + "\n")
    manifest = folder / "set" / "m.toml"
    manifest.write_text('list = "list.csv"\ntime = "t"\ngap = "gap [mm]"\nforce = "f"\n')
    recordings = list(readable_or_not("manifest", str(manifest)))
    labels = [getattr(recording, "label", "") for recording in recordings]
    assert labels == ["a", "b", "c", "", "", "", "", "h"]
    lines = [recording.line for recording in recordings if isinstance(recording, UnreadableRecording)]
    words = ("line 5: there is no file", "/dev/zero", "first_row", "first_row")
    assert all(word in line for word, line in zip(words, lines, strict=True))


def test_where_none_can_be_read_the_first_is_told(folder):
    for path in folder.glob("*.npz"):
        flipped_in_the_middle(path)
    with pytest.raises(DataDamaged, match=r" 6 .*can_2\.npz"):
        load_trials(f"manifest:{folder / 'manifest.toml'}")


# Recordings of our own with contents that no grasp has. Their checksums are right.


def crafted(path, ticks=(), result=None, **sections):
    file = RecordingWriter(path)
    record = ended()
    file.metadata(START, {**record.section(START), **sections})
    for tick in ticks:
        file.tick(TICK.pack(*tick))
    file.metadata(RESULT, {**record.section(RESULT), **(result or {})})
    file.finish()


def tick(k=0, phase=3, **values):
    return (*frame(k)._replace(**values), phase, EFFORT, 1.0, 2.0, 3.0)


EVENT = '{{"events": [{{"t_s": {t_s}, "phase": "{phase}", "what": "x", "source": "controller"}}]}}'
DETAILS = {
    "events no table": '{"events": [1, "a", null]}',
    "events a number": '{"events": 7}',
    "event of no phase": EVENT.format(t_s=1, phase="flight"),
    "event at no time": EVENT.format(t_s="[]", phase="hold"),
}
CRAFTED = {
    "phase 100": {"ticks": [tick(0), tick(1, phase=100)]},
    "phase -1": {"ticks": [tick(0, phase=-1)]},
    "time NaN": {"ticks": [tick(0), tick(1, t_s=float("nan"))]},
    "time inf": {"ticks": [tick(0), tick(1, t_s=float("inf"))]},
    "outcome 99": {"ticks": [tick()], "result": {"outcome": "99"}},
    **{name: {"ticks": [tick()], "result": {"details": text}} for name, text in DETAILS.items()},
    "overflow": {
        "ticks": [tick()],
        "result": {"features": f'{{"features": [["a", "m"]], "values": [1{"0" * 400}], "reasons": {{}}}}'},
    },
    "deep": {"ticks": [tick()], "provenance": "[" * 100_000},
    "labels a list": {"ticks": [tick()], "labels": "[1]"},
    "settings no table": {"ticks": [tick()], "settings": "gripper = 1"},
}


@every_case("kind", CRAFTED)
def test_impossible_contents_are_damage_of_this_recording(tmp_path, kind):
    path = tmp_path / "g.mcap"
    crafted(path, **CRAFTED[kind])
    with pytest.raises(DataDamaged, match=r"g\.mcap"):
        read_recorded(path).record()


@every_case(
    ("name", "array"),
    [
        ("gap_m", np.zeros((30, 2))),
        ("gap_m", np.array([f"{k} m" for k in range(30)])),
        ("gap_m", np.zeros(29)),
        ("t_s", np.full(30, np.nan)),
        ("status", np.full(30, 1e300)),
        ("pad_left", np.zeros((0, 3))),
        ("pad_left", np.zeros((2, 22, 2))),
        (
            "declared",
            np.array('{"channels": [], "device": 1, "rate_hz": 1e999, "units": {}, "has_release": 0}'),
        ),
        ("declared", np.array('{"channels": 7}')),
    ],
)
def test_an_exported_grasp_of_other_shapes_is_damage_of_this_file(name, array, tmp_path):
    write_recording(tmp_path / "g.mcap", 30, ended())
    write_npz(tmp_path / "g.npz", read_recorded(tmp_path / "g.mcap"))
    assert len(read_named("npz", str(tmp_path / "g.npz")).readings) == 30
    with np.load(tmp_path / "g.npz", allow_pickle=False) as arrays:
        np.savez(tmp_path / "bad.npz", **{**arrays, name: array})
    with pytest.raises(DataDamaged, match=r"bad\.npz"):
        read_named("npz", str(tmp_path / "bad.npz"))


def test_no_ticks_is_no_recording_to_replay(tmp_path):
    path = tmp_path / "g.mcap"
    crafted(path)
    with pytest.raises(DataDamaged, match=r"g\.mcap"):
        read_named("mcap", str(path))


def test_of_a_store(tmp_path):
    folder = tmp_path / "trials"
    with Store.open(folder) as store:
        for k in range(6):
            label = "can:full" if k % 2 else "can:empty"
            keep(store, label, f"can#{k % 3}", values=(0.06 + k / 1000, 5.0), ticks=30, grasp=k)
        names = [store.summary(k + 1).recording for k in range(6)]
        with store.transaction() as connection:
            connection.execute("UPDATE trial SET \"values\" = x'00' WHERE id = 2")
            connection.execute("UPDATE detail SET labels = '[' WHERE trial = 3")
            connection.execute("UPDATE trial SET made_at = 'then' WHERE id = 6")
    crafted(folder / "recordings" / "phase.mcap", ticks=[tick(phase=100)])
    (folder / "recordings" / names[3]).write_bytes((folder / "recordings" / "phase.mcap").read_bytes())

    trials = load_trials(f"store:{folder}")
    assert len(trials) == 3
    assert any("3 trials left" in note for note in trials.notes)

    trials = load_trials(f"store:{folder}", options=["features.force=left"])
    assert len(trials) == 2
    assert any("1 of 3 recordings" in note and names[3] in note for note in trials.notes)

    problems = verify_store(folder).problems
    for number in (2, 3, 4, 6):
        assert any(problem.startswith(f"trial {number}:") for problem in problems)
    printed("report", folder, "--out", tmp_path / "page")
    (page,) = (tmp_path / "page").glob("*.html")
    assert "left out" in page.read_text()


def test_what_is_ours_passes_through_and_what_is_not_is_named():
    for error, expected in (
        (KeyError("x"), DataDamaged),
        (RecursionError("deep"), DataDamaged),
        (MemoryError(), TooLarge),
        (OSError("no number"), DataDamaged),
        (OSError(errno.EINVAL, "Invalid argument"), DataDamaged),
        (PermissionError(errno.EACCES, "Permission denied"), ConfigError),
    ):
        with pytest.raises(expected) as told, readable("a.file"):
            raise error
        assert "a.file" in str(told.value)
        assert told.value.__cause__ is error
    for error in (ConfigError("ours"), KeyboardInterrupt()):
        with pytest.raises(type(error)) as told, readable("a.file"):
            raise error
        assert told.value is error
    with pytest.raises(KeyboardInterrupt):
        list(each_readable("a.file", lambda: (_ for _ in ()).throw(KeyboardInterrupt)))


def dataset_of(reader, monkeypatch):
    """Install a data set `lab` whose reader is this function."""
    dataset = SimpleNamespace(qualified="lab-data/lab", recordings=lambda: reader)
    plugins = SimpleNamespace(resource=lambda kind, name: {"lab": dataset}[name])
    monkeypatch.setattr("graspsense.sources.recordings.dataset_recordings.installed", lambda: plugins)


def grasps(number):
    """Return recordings with a frame each; the third has none, the fourth has a time that is no number."""
    recording = Recording(name="r", readings=(Reading(frame(0), NO_PADS, ()),), rate_hz=10.0)
    for k in range(number):
        readings = recording.readings if k != 2 else ()
        if k == 3:
            readings = (Reading(frame(0)._replace(t_s=float("nan")), NO_PADS, ()),)
        yield LabelledRecording(recording=evolve(recording, readings=readings), source=f"r{k}", label="can")


def test_of_a_plugin(monkeypatch):
    def fails_after_five(place):
        yield from grasps(5)
        raise ZeroDivisionError("no scale")

    dataset_of(fails_after_five, monkeypatch)
    recordings = list(readable_or_not("lab", "place"))
    unreadable = [isinstance(recording, UnreadableRecording) for recording in recordings]
    assert unreadable == [False, False, True, True, False, True]
    assert "no frames" in recordings[2].line
    assert "time" in recordings[3].line
    assert re.search(
        r"behind recording 5.*lab-data/lab failed.*ZeroDivisionError: no scale", recordings[5].line
    )

    def fails_at_once(place):
        raise ZeroDivisionError("no scale")
        yield

    dataset_of(fails_at_once, monkeypatch)
    with pytest.raises(ComponentFailed, match="ZeroDivisionError"):
        list(readable_or_not("lab", "place"))


def test_a_mistake_in_a_reader_is_raised_where_plugins_are_strict(monkeypatch):
    def wrong(place):
        yield from each_readable("a.file", lambda: [undefined])  # noqa: F821

    dataset_of(wrong, monkeypatch)
    (recording,) = readable_or_not("lab", "place")
    assert "NameError" in recording.line
    monkeypatch.setenv(STRICT_VARIABLE, "1")
    with pytest.raises(NameError):
        list(readable_or_not("lab", "place"))


@every_case(
    ("given", "told"),
    [
        ({"order": "10"}, "order is a number, not '10'"),
        ({"values": {"fill [ml]": "much"}}, r"fill \[ml\] is a number, not 'much'"),
        ({"source": 3}, "source is text, not 3"),
        ({"instance": 3}, "an instance is text, not 3"),
    ],
)
def test_what_a_reader_says_of_a_recording_has_the_types_that_its_fields_name(folder, given, told):
    (good, *_) = readable_or_not("manifest", str(folder / "manifest.toml"))
    assert evolve(good, order=np.int64(10), values={"fill [ml]": np.float32(2.0)}).order == 10
    with pytest.raises(TypeError, match=told):
        evolve(good, **given)
