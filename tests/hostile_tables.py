"""Texts that are nearly tables, manifests, settings or scenes: made from valid ones by a fixed seed, and read.

    python tests/hostile_tables.py SEED NUMBER

reads so many texts of each format under a limit on memory, counts the work, and prints what was answered badly as JSON.
"""

from __future__ import annotations

import json
import random
import re
import resource
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path

from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import GraspsenseError
from graspsense.experiments.experiment_file import read_experiment
from graspsense.recording.export_trace import declared_beside
from graspsense.recording.labelled_recording import UnreadableRecording
from graspsense.recording.layout import TICK_FIELDS
from graspsense.sources.manifest.reader import read_recordings
from graspsense.sources.recordings.exported_grasp import read_exported
from graspsense.sources.recordings.grasp_csv import read_squeeze
from graspsense.sources.trial_table.features_csv import read_labelled
from graspsense_c45.arff import ArffError, read_arff
from graspsense_sim_gripper.scene.library import find

MEMORY_BYTES = 2**30
"""Memory that reading may take beside what the program itself has."""
MOST_CALLS = 5_000_000
"""Calls of functions that reading one small text may take; an honest one takes some thousand."""

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

STRANGE = (
    *'"\'\\[]{}()=,;#%*?./~|@:<>-+ \t\r\n\v\f\0',
    "\ufeff", "\u2028", "\udcff", "é", "٣", "nan", "inf", "-inf", "1e400", "1e308", "-1e308", "5e-324", "-0", "1_0",
    "1,5", "9223372036854775808", "-9223372036854775809", "9" * 5000, "0x" + "f" * 3000, "1e99999", "0", "-1", "1e9",
    "true", "[]", "{}", '"""', "'''", "x" * 600, "F" * 3000, "9**9**9", "F/0", "'a'*9", "first(F)", "sum('*')", "F[9]",
    "(a+)+$", "(?=a)", r"(\\w)\\1", "(?P<label>", "(?P<label>x)", "a{1000}{1000}", "((((((((a*)*)*)*)*)*)*)*)*$",
    "**/", "{label}", "{label:d}", "{label}{label}", "../..", "~nobody", "store:", "#3", "1970-01-01", "[mm]", "[N]",
    "a." * 200 + "a", "[" * 200, "{a=" * 200, "@data", "@attribute", "@attribute x {a,a}", "{0 1}", "= 1", "[[terms]]",
    "[data]", "\n\n", ",,,", "null", "NaN", "[[[[[[[[[[", "=1+cmd|' /C calc'!A0",
)  # fmt: skip


NUMBERS = (
    "0", "-1", "0.0", "-0.0", "1e308", "5e-324", "inf", "-inf", "nan", "9223372036854775807", "-9223372036854775808",
    "9223372036854775808", "1e9", "1000000", "0.5", "3", "1" * 4000, "0x" + "f" * 3000, "4294967296", "1.0e-300",
)  # fmt: skip
KEYS = (
    "files", "list", "folder", "start", "split", "time", "rate_hz", "gap", "force", "left", "effort", "velocity",
    "channels", "fast", "zero", "cut", "resample_hz", "duplicates", "label", "instance", "recorded", "order", "values",
    "seeds", "seed", "total", "trials", "instances", "folds", "grasps", "objects", "checkpoints_s", "type", "extends",
    "parts", "variants", "sweep", "timeout_s", "width_m", "offset_m", "share", "held", "patch", "named", "groups",
)  # fmt: skip


def tokens(text: str) -> list[str]:
    """Return the words, spaces and signs of a text."""
    return re.findall(r"\w+|\s|[^\w\s]", text)


def toml_value(rng: random.Random) -> str:
    """Return a strange value that is TOML."""
    strange = rng.choice(STRANGE)
    match rng.randrange(6):
        case 0:
            return rng.choice(NUMBERS)
        case 1:
            return f"[{', '.join(rng.choices(NUMBERS, k=rng.choice((0, 1, 3, 20))))}]"
        case 2:
            return rng.choice(
                ("true", "{}", "[]", "[[]]", "1979-05-27T07:32:00", "{ a = 1 }", '["a", 1]', "[{}, {}]")
            )
        case _:
            return json.dumps(strange.encode("utf-8", "replace").decode(), ensure_ascii=False).replace(
                "\x7f", ""
            )


def one_value_changed(text: str, rng: random.Random) -> str:
    """Return the text with a value of a key, a key, a cell or a row changed, still well formed."""
    lines = text.split("\n")
    place = rng.choice([k for k, line in enumerate(lines) if line])
    key, equals, _ = lines[place].partition(" = ")
    cells = lines[place].split(",")
    if rng.randrange(8) == 0 and len(lines[place]) < 1000:
        lines[place:place] = [lines[place]] * rng.choice((1, 400))
    elif equals and rng.randrange(6):
        lines[place] = f"{key} = {toml_value(rng)}"
    elif equals:
        lines.insert(place, f"{rng.choice(KEYS)} = {toml_value(rng)}")
    else:
        cells[rng.randrange(len(cells))] = re.sub(r'[,"\r\n]', "", rng.choice(STRANGE))
        lines[place] = ",".join(cells)
    return "\n".join(lines)


def changed(text: str, rng: random.Random) -> bytes:
    """Return a changed text: half of the time still well formed, else with a few of its tokens in disorder."""
    if rng.randrange(3):
        for _ in range(rng.choice((1, 1, 1, 2, 4))):
            text = one_value_changed(text, rng)
        return text.encode("utf-8", "surrogateescape")
    parts = tokens(text)
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        place = rng.randrange(len(parts))
        match rng.randrange(7):
            case 0:
                parts[place] = rng.choice(STRANGE)
            case 1:
                parts.insert(place, rng.choice(STRANGE))
            case 2:
                del parts[place : place + rng.choice((1, 1, 5))]
            case 3:
                parts[place:place] = parts[place : place + rng.choice((1, 3, 12))]
            case 4:
                parts[place] *= rng.choice((2, 300))
            case 5:
                other = rng.randrange(len(parts))
                parts[place], parts[other] = parts[other], parts[place]
            case _:
                parts[place] = rng.choice(parts)
        if not parts:
            break
    data = "".join(parts).encode("utf-8", "surrogateescape")
    match rng.randrange(12):
        case 0:
            data = data[: rng.randrange(len(data) + 1)]
        case 1:
            data = b"\xef\xbb\xbf" + data
        case 2:
            data = data.decode("utf-8", "replace").encode("utf-16")
        case 3:
            data = data.replace(b"\n", b"\r\n")
    return data


def _manifest(folder: Path, manifest: str, rng: random.Random) -> None:
    which = rng.randrange(3)
    grasp = GRASP if manifest != STARTED else f"grasp jar 1\n{GRASP}grasp can 2\n{GRASP}"
    for name, text, mutate in (
        ("manifest.toml", manifest, which != 1),
        ("grasp.csv", grasp, which == 1),
        ("list.txt", LIST, which == 2),
    ):
        (folder / name).write_bytes(changed(text, rng) if mutate else text.encode())
    for recording in read_recordings(str(folder / "manifest.toml")):
        if isinstance(recording, UnreadableRecording):
            _check_words(
                recording.error, f"{recording.source} {recording.error}", ("grasp", "manifest", "list.txt")
            )


def _check_words(error: Exception, words: str, names: tuple[str, ...]) -> None:
    """Raise AssertionError unless this is an error of a file that names the file."""
    if not isinstance(error, ArffError):
        assert isinstance(error, GraspsenseError), f"{type(error).__name__}: {error}"
        assert error.exit_code in (2, 5), f"exit code {error.exit_code}: {error}"
    assert any(name in words for name in (*names, tempfile.gettempdir())), (
        f"no file is named in: {words[:200]}"
    )
    assert len(words) < 100_000, f"{len(words)} characters of words"


def _grasp(folder: Path, rng: random.Random) -> None:
    (folder / "grasp.csv").write_bytes(changed(GRASP, rng))
    read_squeeze(f"{folder}/grasp.csv?time=t&gap=g*0.001&force=F")


def _features(folder: Path, rng: random.Random) -> None:
    (folder / "features.csv").write_bytes(changed(FEATURES, rng))
    read_labelled(folder / "features.csv", "label", instance=rng.choice((None, "instance")))


def _exported(folder: Path, rng: random.Random) -> None:
    which = rng.randrange(2)
    (folder / "grasp.csv").write_bytes(changed(TICKS, rng) if which else TICKS.encode())
    declared_beside(folder / "grasp.csv").write_bytes(DECLARED.encode() if which else changed(DECLARED, rng))
    read_exported(str(folder / "grasp.csv"))


def _arff(folder: Path, rng: random.Random) -> None:
    (folder / "grasps.arff").write_bytes(changed(ARFF, rng))
    read_arff(folder / "grasps.arff")


def _pipeline(folder: Path, rng: random.Random) -> None:
    (folder / "pipeline.toml").write_bytes(changed(PIPELINE, rng))
    resolve(str(folder / "pipeline.toml"))


def _experiment(folder: Path, rng: random.Random) -> None:
    (folder / "experiment.toml").write_bytes(changed(EXPERIMENT, rng))
    read_experiment(str(folder / "experiment.toml"))


def _scene(folder: Path, rng: random.Random) -> None:
    (folder / "scene.toml").write_bytes(changed(SCENE, rng))
    find(str(folder / "scene.toml"))


FORMATS: dict[str, tuple[Callable[[Path, random.Random], None], tuple[str, ...]]] = {
    "manifest": (
        lambda folder, rng: _manifest(folder, MANIFEST, rng),
        ("manifest.toml", "list.txt", "grasp.csv"),
    ),
    "start": (lambda folder, rng: _manifest(folder, STARTED, rng), ("manifest.toml", "grasp.csv")),
    "list": (lambda folder, rng: _manifest(folder, BY_LIST, rng), ("manifest.toml", "list.txt", "grasp.csv")),
    "grasp": (_grasp, ("grasp.csv",)),
    "features": (_features, ("features.csv",)),
    "exported": (_exported, ("grasp",)),
    "arff": (_arff, ("grasps.arff",)),
    "pipeline": (_pipeline, ("",)),
    "experiment": (_experiment, ("",)),
    "scene": (_scene, ("scene.toml",)),
}
"""Each format: what writes a changed text and reads it, and the files that an error has to name one of."""


class _Work:
    """Counts calls of functions, and ends what takes too many."""

    def __init__(self) -> None:
        self.calls = 0

    def __enter__(self) -> _Work:
        sys.setprofile(self._count)
        return self

    def __exit__(self, *error: object) -> None:
        sys.setprofile(None)

    def _count(self, frame: object, event: str, argument: object) -> None:
        self.calls += 1
        if self.calls > MOST_CALLS:
            sys.setprofile(None)
            raise AssertionError(f"more than {MOST_CALLS} calls")


def bad_answers(seed: int, number: int) -> Iterator[dict[str, object]]:
    """Yield each text of each format that was answered by anything but a result or an error that names the file."""
    for name, (read, files) in FORMATS.items():
        for k in range(number):
            with tempfile.TemporaryDirectory() as folder:
                try:
                    with _Work():
                        read(Path(folder), random.Random(f"{seed} {name} {k}"))
                except (GraspsenseError, ArffError) as error:
                    try:
                        _check_words(error, str(error), files)
                    except AssertionError as wrong:
                        yield {"format": name, "number": k, "said": str(wrong)}
                except BaseException as error:
                    yield {"format": name, "number": k, "said": f"{type(error).__name__}: {str(error)[:300]}"}


def main() -> None:
    seed, number = int(sys.argv[1]), int(sys.argv[2])
    warnings.simplefilter("error")
    with _Work():
        resolve("default")  # what is loaded once counts for no text
    with open("/proc/self/statm") as file:
        own = int(file.read().split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (own + MEMORY_BYTES, own + MEMORY_BYTES))
    answers = {"read": number * len(FORMATS), "bad": list(bad_answers(seed, number))}
    sys.stdout.write(json.dumps(answers))


if __name__ == "__main__":
    main()
