"""Compare two versions of the project to the last bit, and their speed in turn. Simulated grasps.

    python benchmarks/same.py [BASE] [--scenes 60] [--rounds 9] [--only NAME ...] [--keep FOLDER] [--short]

BASE is a commit, or a folder with a checkout; without it, this checkout is compared with itself. It is compared with
the checkout that this file belongs to, which the running interpreter has installed. BASE gets an environment of its
own: the `.venv` of its checkout, or a new one with the same packages (some minutes; `--keep FOLDER` keeps it for the
next time). Compiled code and chosen models are cached apart for each version.

Compared are the traces, outcomes and features of every object of the catalogue under three controllers, with ideal
sensors and with pads, one grasp at a time and as a batch; sixty random scenes of `random_scenes.py`, with the spread of
friction and without; an emulated PR2 gripper; the trees of the C4.5 oracles by both engines; and the default model, as
shipped and trained again. Two numbers are the same where all their bits are; NaN equals NaN. Whatever differs
is listed with the largest difference, and the exit code is then 1. Times are processor times of one thread; the two
versions are timed in turn, and the table gives the median ratio of the rounds with its range.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from datetime import date
from pathlib import Path
from typing import IO, Any, Final

import numpy as np
from arguments import parser_of
from attrs import field, frozen

ROOT: Final = Path(__file__).resolve().parent.parent
PROBE: Final = Path(__file__).with_name("same_probe.py")
COMPARED: Final = (
    "catalogue, single",
    "catalogue, batch",
    "random scenes",
    "emulated PR2",
    "C4.5 oracles",
    "default model",
)
PACKAGES: Final = ("numpy", "numba", "llvmlite", "scipy", "scikit-learn")
LISTED: Final = 12
"""Differences of one group that are listed by name."""


@frozen(kw_only=True)
class Version:
    """A checkout and the interpreter that has it installed."""

    name: str
    checkout: Path
    python: Path


class Probe:
    """A process of one version that answers requests."""

    def __init__(self, version: Version, cache: Path) -> None:
        self.name = version.name
        # The same single thread and no cache of another version's models or compiled code.
        environment = {**os.environ, "XDG_CACHE_HOME": str(cache), "OMP_NUM_THREADS": "1"}
        environment.pop("PYTHONPATH", None)
        self._process = subprocess.Popen(
            [str(version.python), "-P", str(PROBE)],
            cwd=version.checkout,
            env=environment,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def __enter__(self) -> Probe:
        return self

    def __exit__(self, *error: object) -> None:
        self._process.kill()
        self._process.communicate()

    def send(self, request: Mapping[str, Any]) -> None:
        requests: IO[str] | None = self._process.stdin
        assert requests is not None
        print(json.dumps(request), file=requests, flush=True)

    def answer(self) -> dict[str, Any]:
        """Return the answer to the request before. Raises SystemExit where the process has ended."""
        answers: IO[str] | None = self._process.stdout
        assert answers is not None
        line = answers.readline()
        if not line:
            raise SystemExit(f"same: the process of {self.name} ended; its error is above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def ask(self, request: Mapping[str, Any]) -> dict[str, Any]:
        self.send(request)
        return self.answer()


@frozen(kw_only=True)
class Difference:
    """One array that is not the same in both versions."""

    name: str
    what: str
    largest: float = field(default=float("nan"))


def difference(name: str, base: np.ndarray | None, here: np.ndarray | None) -> Difference | None:
    """Return how an array differs between the versions; None where every bit is the same."""
    if base is None or here is None:
        return Difference(name=name, what="only in BASE" if here is None else "only in this checkout")
    if base.shape != here.shape:
        return Difference(name=name, what=f"shape {base.shape} became {here.shape}")
    if base.dtype.kind in "US" or here.dtype.kind in "US":
        same = bool(np.array_equal(base, here))
        return None if same else Difference(name=name, what=f"{base.tolist()} became {here.tolist()}")
    old, new = base.astype(float), here.astype(float)
    unlike = (old.view(np.int64) != new.view(np.int64)) & ~(np.isnan(old) & np.isnan(new))
    if not unlike.any():
        return None
    unlike_at = int(np.flatnonzero(unlike.ravel())[0])
    largest = float(np.nanmax(np.abs(new - old)))
    what = (
        f"{int(unlike.sum())} of {unlike.size} numbers, the first at index {unlike_at}: "
        f"{old.ravel()[unlike_at]!r} became {new.ravel()[unlike_at]!r}"
    )
    return Difference(name=name, what=what, largest=largest)


def differences(base: Path, here: Path) -> tuple[int, list[Difference]]:
    """Return how many arrays were compared and those that differ."""
    with np.load(base) as old, np.load(here) as new:
        names = list(dict.fromkeys([*old.files, *new.files]))
        pairs = [
            (name, old[name] if name in old.files else None, new[name] if name in new.files else None)
            for name in names
        ]
    compared = [difference(name.replace("|", "/"), *pair) for name, *pair in pairs]
    return len(names), [unlike for unlike in compared if unlike is not None]


def run(*words: str | Path, cwd: Path = ROOT) -> str:
    return subprocess.run(
        [str(word) for word in words], cwd=cwd, check=True, stdout=subprocess.PIPE, text=True
    ).stdout


def base_version(base: str, keep: Path) -> Version:
    """Return BASE with an environment that has it installed, made in `keep` where there is none yet."""
    if Path(base).is_dir():
        checkout, name = Path(base).resolve(), base
        if checkout == ROOT:
            return Version(name="here", checkout=ROOT, python=Path(sys.executable))
        home = keep / "environment"
    else:
        name = run("git", "rev-parse", "--short=12", f"{base}^{{commit}}").strip()
        home = keep / name
        checkout = home / "checkout"
        if not checkout.exists():
            checkout.mkdir(parents=True)
            archive = home / "checkout.tar"
            run("git", "archive", "--output", archive, name)
            shutil.unpack_archive(archive, checkout, filter="data")
            archive.unlink()
    own = checkout / ".venv" / "bin" / "python"
    if own.exists():
        return Version(name=name, checkout=checkout, python=own)
    python = home / "environment" / "bin" / "python"
    if not python.exists():
        print(f"same: installing {name} (some minutes)", file=sys.stderr)
        run(sys.executable, "-m", "venv", python.parent.parent)
        run(python, "-m", "pip", "install", "--quiet", "-r", "requirements-dev.txt", cwd=checkout)
    return Version(name=name, checkout=checkout, python=python)


def catalogue() -> list[str]:
    """Return the names of all objects of the catalogue, each in each of its states."""
    from graspsense_sim_gripper.scene.library import catalogue as specs

    return list(specs())


def scene_files(count: int, folder: Path) -> list[dict[str, Any]]:
    """Write random scenes of `random_scenes.py` as files; return each with its gripper settings and speed."""
    from random_scenes import scene_of

    from graspsense.core.files.toml_text import toml_value

    scenes = []
    for number in range(count):
        scene = scene_of(number)
        path = folder / f"scene{number}.toml"
        values = {key: getattr(scene.spec, key) for key in ("width_m", "offset_m", "mass_kg", "held")}
        values["terms"] = [{"type": kind, **numbers} for kind, numbers in scene.spec.terms]
        lines = (f"{key} = {toml_value(value)}\n" for key, value in values.items())
        path.write_text("".join(lines), encoding="utf-8")
        keys = (
            "open_gap_m",
            "damping_n_s_m",
            "pad_stiffness_n_m",
            "pad_damping_n_s_m",
            "pad_creep_n_m",
            "pad_creep_s",
        )
        config = {key: float(getattr(scene.config, key)) for key in keys} | {"sensor": "ideal"}
        scenes.append({"file": str(path), "config": config, "speed_m_s": scene.speed_m_s})
    return scenes


def versions_of(version: Version) -> dict[str, str]:
    """Return the versions of the packages that decide bits."""
    code = (
        "import json, platform, importlib.metadata as m; "
        f"print(json.dumps({{'python': platform.python_version(), **{{n: m.version(n) for n in {PACKAGES!r}}}}}))"
    )
    versions: dict[str, str] = json.loads(run(version.python, "-c", code))
    return versions


def compare(probes: Sequence[Probe], names: Sequence[str], request: dict[str, Any], folder: Path) -> bool:
    """Record each group in both versions, side by side, print what differs, and return whether anything does."""
    differ = False
    print(f"{'group':<20} {'compared':>9} {'different':>9}")
    for name in names:
        files = [folder / f"{k}.npz" for k in range(2)]
        for probe, path in zip(probes, files, strict=True):
            probe.send({**request, "record": name, "to": str(path)})
        for probe in probes:
            probe.answer()
        count, unlike = differences(*files)
        print(f"{name:<20} {count:>9} {len(unlike):>9}", flush=True)
        for array in unlike[:LISTED]:
            print(f"  {array.name}: {array.what} (largest {array.largest:g})")
        if len(unlike) > LISTED:
            print(f"  and {len(unlike) - LISTED} more")
        differ = differ or bool(unlike)
    return differ


def time_in_turn(probes: Sequence[Probe], request: dict[str, Any], rounds: int) -> None:
    """Print the ratio of times, this checkout over BASE, of each thing that is timed."""
    names, _ = [probe.ask({**request, "prepare": True})["timings"] for probe in probes]
    print(f"\n{'processor time':<32} {'BASE s':>9} {'here s':>9} {'ratio':>6}  range")
    for name in names:
        pairs = [[probe.ask({"time": name})["s"] for probe in probes] for _ in range(rounds)]
        base_s, here_s = (statistics.median(times_s) for times_s in zip(*pairs, strict=True))
        ratios = sorted(here / base for base, here in pairs)
        print(
            f"{name:<32} {base_s:>9.4f} {here_s:>9.4f} {statistics.median(ratios):>6.3f}"
            f"  {ratios[0]:.3f} to {ratios[-1]:.3f}",
            flush=True,
        )


def parsed() -> argparse.Namespace:
    parser = parser_of(__doc__)
    parser.add_argument(
        "base", nargs="?", default=str(ROOT), help="a commit, or a folder with a checkout (this checkout)"
    )
    parser.add_argument("--scenes", type=int, default=60, help="how many random scenes (60)")
    parser.add_argument(
        "--rounds", type=int, default=9, help="how often each version is timed (9); 0: not at all"
    )
    parser.add_argument(
        "--only", nargs="+", choices=COMPARED, default=COMPARED, help="the groups that are compared"
    )
    parser.add_argument(
        "--keep", type=Path, help="folder that keeps the environment of BASE for the next time"
    )
    given = parser.parse_args()
    if given.short:
        given.rounds, given.only = 0, COMPARED[:1]
    return given


def main() -> int:
    """Compare, print, and return 1 where something differs."""
    given = parsed()
    with ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="graspsense-same.")))
        keep = folder if given.keep is None else given.keep.resolve()
        keep.mkdir(parents=True, exist_ok=True)
        here = Version(name="here", checkout=ROOT, python=Path(sys.executable))
        base = base_version(given.base, keep)
        request = {
            "objects": catalogue()[:2] if given.short else catalogue(),
            "c45": str(ROOT / "plugins" / "c45" / "tests" / "weka"),
            "folder": str(folder),
            "scenes": scene_files(given.scenes, folder) if "random scenes" in given.only else [],
        }
        probes = [
            stack.enter_context(Probe(version, folder / f"cache{k}"))
            for k, version in enumerate((base, here))
        ]
        print(
            f"{base.name} (BASE) and {run('git', 'describe', '--always', '--dirty').strip()} (this checkout)"
        )
        print(f"{date.today()}, {platform.machine()}, {os.cpu_count()} processors, {platform.system()}\n")
        packages = [versions_of(version) for version in (base, here)]
        if packages[0] != packages[1]:
            print(f"Packages differ: {packages[0]} and {packages[1]}.\n")
        differ = compare(probes, given.only, request, folder)
        if given.rounds:
            time_in_turn(probes, request, given.rounds)
    return 1 if differ else 0


if __name__ == "__main__":
    sys.exit(main())
