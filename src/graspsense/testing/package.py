"""Conformance checks of a distribution: its plugins load quickly, and all that they name exists, also in its wheel."""

from __future__ import annotations

import importlib.util
import json
import os
import re
import subprocess
import sys
import tempfile
import time
import tomllib
import zipfile
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any, Final
from urllib.parse import unquote, urlparse

import click

from graspsense.core.components.entries import ConformanceCheckEntry, ExperimentKindEntry, PipelineEntry
from graspsense.core.components.registry import SLOW_IMPORT_S, Resource
from graspsense.core.pipeline.wiring import check as check_wiring
from graspsense.core.settings.resolved import resolve
from graspsense.core.values.errors import GraspsenseError
from graspsense.testing.checks import Check, CheckFailed, CheckSkipped, demand, raises_nothing
from graspsense.testing.component import ADVICE_ON_IMPORTS
from graspsense.testing.samples import a_trial, an_event, contents_of
from graspsense.testing.subject import Package, printed_afresh

PROBE_S: Final = 1.0
OBSERVER_S: Final = 2.0
_ADVICE_ON_OBSERVERS: Final = ": an observer that raises is passed over from then on; catch what may go wrong"


def plugins_load(package: Package) -> None:
    """Every plugin of the distribution can be imported, is written for this API, and violates no rule."""
    for status in package.statuses:
        demand(
            status.state == "loaded",
            f"{status.entry_point} = {status.module} is {status.state}: {status.reason}"
            + (f"\n    {ADVICE_ON_IMPORTS}" if "ModuleNotFoundError" in status.reason else ""),
        )


def plugin_modules_are_light(package: Package) -> None:
    """Listing it imports neither numpy nor a driver, and takes no noticeable time."""
    code = (
        "import json, sys\n"
        "import graspsense.core.components.registry as p\n"
        "name = sys.stdin.read()\n"
        "took = [s.import_s for s in p.installed().statuses if s.distribution == name]\n"
        "print(json.dumps({'heavy': sorted(p.HEAVY & set(sys.modules)), 'took': max(took, default=0.0)}))"
    )
    listed = json.loads(
        printed_afresh(
            code,
            given=package.distribution.encode(),
            PYTHONPATH=os.pathsep.join(place for place in sys.path if place),
            GRASPSENSE_PLUGINS=package.distribution,
            GRASPSENSE_TRACE_PLUGINS="",
        )
    )
    demand(
        not listed["heavy"],
        f"listing it imports {', '.join(listed['heavy'])}: in the module of the entry point import "
        "graspsense.plugin_api and its like only; name classes by import strings, and import what is heavy inside them",
    )
    demand(
        listed["took"] <= 5.0 * SLOW_IMPORT_S,
        f"importing it takes {listed['took'] * 1e3:.0f} ms of processor time: do less in the module of the entry point",
    )


def everything_declared_loads(package: Package) -> None:
    """Every file, reader, command and kind of experiment that it declares can be loaded."""
    for resource in package.resources:
        if resource.is_file:
            resource.file()
        for part in resource.targets:
            loaded = resource.load(part)
            what = "a click command" if resource.kind == "command" else "a function or a class"
            demand(
                callable(loaded) and (what != "a click command" or isinstance(loaded, click.Command)),
                f"{getattr(resource.entry, part)}, `{part}` of {resource.qualified}, is {loaded!r:.60}: name {what}",
            )
        if isinstance(resource.entry, ExperimentKindEntry):
            for part in {"keys", "result"} & set(resource.targets):
                resource.class_of_kind(part)


def names_are_unique(package: Package) -> None:
    """No other installed distribution uses the name of one of its components or resources."""
    for mine in (*package.components, *package.resources):
        others = package.plugins.namesakes(mine)
        demand(
            not others,
            f"the name {mine.name!r} is taken by {', '.join(others)}: choose another name in the entry, or its users "
            f'must write "{mine.qualified}"',
        )


def pipelines_fit_together(package: Package) -> None:
    """Every pipeline file it ships resolves, and its components fit each other."""
    names = [
        resource.qualified for resource in package.resources if isinstance(resource.entry, PipelineEntry)
    ]
    if not names:
        raise CheckSkipped("it ships no pipeline")
    for name in names:
        try:
            check_wiring(resolve(name, plugins=package.plugins))
        except GraspsenseError as error:
            raise CheckFailed(f"pipeline {name}: {error}") from error


def observers_change_nothing(package: Package) -> None:
    """Observers raise nothing, return nothing, and do not change their arguments."""
    trial = a_trial()
    run, event = trial.run, an_event()
    arguments: dict[str, dict[str, Any]] = {
        "graspsense_run_starting": {"run": run},
        "graspsense_grasp_event": {"run": run, "event": event},
        "graspsense_run_finished": {"run": run, "trial": trial},
    }
    mine = [(status, hook) for status in package.statuses for hook in arguments if hook in status.hooks]
    if not mine:
        raise CheckSkipped("it observes nothing")
    given = repr((run, trial.features)), contents_of(trial.trace)
    for status, hook in mine:
        began = time.perf_counter()
        with raises_nothing(f"{hook} of {status.entry_point}", _ADVICE_ON_OBSERVERS):
            results = package.plugins.called(status, hook, **arguments[hook])
        took = time.perf_counter() - began
        demand(not results, f"{hook} returned {results}: an observer returns nothing")
        demand(
            took <= OBSERVER_S,
            f"{hook} took {took:.1f} s, and the grasp waits for it: hand the work to a thread",
        )
    demand(
        (repr((run, trial.features)), contents_of(trial.trace)) == given,
        "an observer changed its arguments: work on a copy",
    )


def probe_returns_in_time(package: Package) -> None:
    """The search for devices ends in time and raises nothing, whatever is connected."""
    if not any("graspsense_probe_devices" in status.hooks for status in package.statuses):
        raise CheckSkipped("it looks for no devices")
    began = time.perf_counter()
    answers = package.plugins.probe_devices(PROBE_S)
    took = time.perf_counter() - began
    for answer in answers:
        demand(
            not answer.error or answer.distribution != package.distribution,
            f"graspsense_probe_devices raised {answer.error}: return what was found",
        )
    demand(
        took <= 3.0 * PROBE_S,
        f"graspsense_probe_devices({PROBE_S:g}) took {took:.1f} s: keep to `timeout_s`",
    )


def wheel_is_complete(package: Package) -> None:
    """The installed files are complete; for an editable installation, a wheel is built and examined."""
    folder = _editable_folder(package.distribution)
    if folder is None:
        return  # Installed from a wheel: the other checks examine its content.
    if not package.builds:
        raise CheckSkipped("no wheel was asked for (--no-wheel)")
    with tempfile.TemporaryDirectory() as scratch:
        wheel = _built(folder, Path(scratch))
        with zipfile.ZipFile(wheel) as archive:
            inside = set(archive.namelist())
    named = {*_modules_of(package), *(part.entry.resource for part in package.resources if part.is_file)}
    for top in sorted({re.split("[.:]", name)[0] for name in named}):
        if not any(place.resolve().is_relative_to(folder) for place in _places(top)):
            continue
        lacking = [name for name in _files_of(top) if name not in inside]
        demand(
            not lacking,
            f"the wheel of {folder.name} lacks {', '.join(lacking[:5])}: {_ADVICE}",
        )


_ADVICE: Final = (
    "it is in the folder but is not packed; in pyproject.toml, with hatchling, [tool.hatch.build.targets.wheel] "
    'packages = ["src/PACKAGE"] takes every file of it that .gitignore does not leave out'
)


def _modules_of(package: Package) -> Iterator[str]:
    for status in package.statuses:
        yield status.module.partition(":")[0]
    for component in package.components:
        targets = (component.entry.target, component.entry.config)
        yield from (target.partition(":")[0] for target in targets if target)
    for resource in package.resources:
        yield from (getattr(resource.entry, part).partition(":")[0] for part in resource.targets)


def _places(top: str) -> list[Path]:
    """Return the folders of a package, or the file of a module; nothing for one that is not there."""
    spec = importlib.util.find_spec(top)
    return [] if spec is None else [*map(Path, spec.submodule_search_locations or [str(spec.origin)])]


def _files_of(top: str) -> list[str]:
    """Return the files of a package as a wheel names them; a module alone is one file."""
    root = _places(top)[0]
    if root.is_file():
        return [f"{top}.py"]
    return [
        f"{top}/{path.relative_to(root).as_posix()}"
        for path in sorted(root.rglob("*"))
        if path.is_file() and not {"__pycache__", ".mypy_cache"} & set(path.parts) and path.suffix != ".pyc"
    ]


def _editable_folder(name: str) -> Path | None:
    """Return the folder that an editable installation points at, or None."""
    try:
        text = distribution(name).read_text("direct_url.json")
    except PackageNotFoundError:
        return None
    origin = json.loads(text) if text else {}
    if not origin.get("dir_info", {}).get("editable"):
        return None
    return Path(unquote(urlparse(origin["url"]).path)).resolve()


def _built(folder: Path, scratch: Path) -> Path:
    project = tomllib.loads((folder / "pyproject.toml").read_text())
    backend = (
        str(project.get("build-system", {}).get("build-backend", "")).partition(":")[0].partition(".")[0]
    )
    here = bool(backend) and importlib.util.find_spec(backend) is not None
    command = [sys.executable, "-P", "-m", "pip", "wheel", "--quiet", "--no-deps"]
    command += ["--disable-pip-version-check", "--wheel-dir", str(scratch)]
    command += [*(["--no-build-isolation"] if here else []), str(folder)]
    ran = subprocess.run(command, capture_output=True, text=True, check=False)
    if "No module named pip" in ran.stderr:
        raise CheckSkipped(
            "pip, which builds the wheel, is not installed in this environment (pip install pip)"
        )
    wheels = list(scratch.glob("*.whl"))
    if ran.returncode or not wheels:
        raise CheckFailed(f"no wheel can be built of {folder.name}: {ran.stderr.strip()[-400:]}")
    return wheels[0]


def contributed_checks(package: Package) -> tuple[Check, ...]:
    """Return the checks of other plugins for those of their hooks that this distribution implements."""
    implemented = {hook for status in package.statuses for hook in status.hooks}
    return tuple(
        Check(contributed.name, contributed.entry.summary, _check_of(contributed))
        for contributed in package.plugins.resources(ConformanceCheckEntry)
        if contributed.entry.hook in implemented
    )


def _check_of(contributed: Resource[ConformanceCheckEntry]) -> Callable[[Package], None]:
    def test(package: Package) -> None:
        hook = contributed.entry.hook
        results = [
            result
            for status in package.statuses
            if hook in status.hooks
            for result in package.plugins.called(status, hook)
        ]
        defects = list(contributed.load()(results))
        demand(not defects, "\n    ".join(defects))

    return test
