"""Writes the package of a new plugin from the templates in this folder."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Mapping, Sequence
from importlib.metadata import packages_distributions
from importlib.resources import files
from importlib.util import find_spec
from pathlib import Path
from string import Template
from typing import Final

from attrs import frozen

from graspsense import __version__
from graspsense.core.components.entries import TABLE_OF_ROLE
from graspsense.core.components.firstparty import DISTRIBUTION, EXAMPLES, SHIPPED
from graspsense.core.components.hookspecs import API
from graspsense.core.components.registry import canonical, installed, installed_sources
from graspsense.core.values.errors import ConfigError, suggestion


@frozen
class ScaffoldKind:
    """What a package has for one role: the module of the component, and the first command to try."""

    module: str
    does: str
    first_command: str
    entry: str = ""
    """The entry that its hook returns, and what this declares; empty for a hook with a template of its own."""
    declares: str = ""
    summary: str = ""
    needs: tuple[str, ...] = ()


NUMPY: Final = ("numpy>=1.26",)
SIMULATOR: Final = ("graspsense-sim-gripper>=0.1,<0.2",)
KINDS: Final[Mapping[str, ScaffoldKind]] = {
    "sensor-backend": ScaffoldKind(
        "backend",
        "a gripper, here a fake one behind the place where its driver goes",
        "graspsense run --gripper $part",
        "SensorBackendEntry",
        'target="$package.backend:${Class}Gripper"',
        "the gripper of our lab",
    ),
    "controller": ScaffoldKind(
        "law",
        "a control law that closes until the fingers rest",
        "graspsense run -o controller.type=$part",
        "ControllerEntry",
        'target="$package.law:${Class}Controller"',
        "raises its effort slowly until the fingers rest on something",
    ),
    "feature-set": ScaffoldKind(
        "features",
        "features of a grasp",
        "graspsense run -o features.type=$part -o classifier.type=none",
        "FeatureSetEntry",
        'target="$package.features:${Class}Features"',
        "greatest force and the gap at it",
        NUMPY,
    ),
    "classifier": ScaffoldKind(
        "classifier",
        "a classifier",
        "graspsense evaluate simulated --classifier $part",
        "ClassifierEntry",
        'target="$package.classifier:${Class}Classifier"',
        "the label whose mean is nearest",
        NUMPY,
    ),
    "sim-term": ScaffoldKind(
        "term",
        "a term of the simulator: a part of an object's force",
        "graspsense run --object $scene -o classifier.type=none",
        needs=SIMULATOR,
    ),
    "dataset": ScaffoldKind(
        "reader",
        "a reader of recorded grasps, which can be evaluated, imported and replayed",
        "graspsense evaluate $part:FOLDER",
        "DatasetEntry",
        'recordings="$package.reader:recordings"',
        "recorded grasps, as $part:FOLDER",
        NUMPY,
    ),
    "observer": ScaffoldKind("observer", "an observer that logs how each grasp ended", "graspsense run"),
}
"""The packages that `plugins new` can make, by the value of `--role`."""
PIPELINE: Final = ScaffoldKind(
    *("", "", "", "PipelineEntry"),
    declares='resource="$package:pipelines/$part.toml"',
    summary="the parts of $name together",
)
"""The pipeline of a package whose components fit together."""

COMMON: Final = ("pyproject.toml", "README.md", ".gitignore", "tests/test_conformance.py")


def make(name: str, roles: Sequence[str], folder: Path) -> list[str]:
    """Write the package `name` with a component for each role to `folder`; return the next steps, one in each line.

    Components of one package fit together: with several, it ships a pipeline of them. Raises ConfigError for an unknown
    or repeated role, an invalid name, or a folder that is not empty.
    """
    kinds = _kinds(roles)
    check_name(name)
    part = name.removeprefix("graspsense-")
    _check_importable(name)
    for component in installed().components():
        taken = component.role in kinds and component.name == part
        if taken and component.distribution != name:
            raise ConfigError(
                f"the {component.kind} name {part!r} is taken by {component.qualified}: choose another name"
            )
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder} is there already: give another name, or --folder")
    words = words_of(name, roles)
    for target, text in _texts(kinds, words).items():
        path = folder / target
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    (folder / "src" / words["package"] / "py.typed").touch()
    return [
        *(f"{folder} has {kind.does}: src/{words['package']}/{kind.module}.py" for kind in kinds.values()),
        f"  pip install -e {folder if folder.is_absolute() else f'./{folder}'} pytest",
        "  graspsense plugins list",
        f"  graspsense plugins check {name}",
        f"  pytest {folder}",
        *(f"  {command}" for command in _first(kinds, {**words, "scene": str(folder / "scene.toml")})),
    ]


def check_name(name: str) -> None:
    """Refuse what is no name of a package. Raises ConfigError."""
    if not re.fullmatch(r"[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        raise ConfigError(
            f"the name {name!r} is not valid: write small letters, digits and single hyphens, a letter first, "
            "without spaces, as in lab-hand"
        )


def words_of(name: str, roles: Sequence[str]) -> dict[str, str]:
    """Return the values of the placeholders in the templates."""
    kinds = _kinds(roles)
    part, together = name.removeprefix("graspsense-"), _together(kinds)
    # The law sends a kind of command that the package's own gripper accepts, or else the simulated gripper.
    kind, command, checks = "effort", "EFFORT, effort, inf, SPEED_M_S", ""
    if "sensor-backend" in kinds:
        kind, command = "velocity", "VELOCITY, -SPEED_M_S, effort, inf"
        checks = ', unplugged={"vanishes_s": 0.5}, absent={"port": "/dev/nowhere"}'
    entries = [kind.entry for kind in kinds.values() if kind.entry] + [PIPELINE.entry] * together
    needs = dict.fromkeys(need for kind in kinds.values() for need in kind.needs)
    tests = ["pytest>=8", *(SIMULATOR if together and "sensor-backend" not in kinds else ())]
    major, minor = map(int, __version__.split(".")[:2])
    words = {
        "name": name,
        "part": part,
        "package": name.replace("-", "_"),
        "term": part.replace("-", "_"),
        "Class": "".join(word.capitalize() for word in part.split("-")),
        "does": kinds[roles[0]].does
        if len(kinds) == 1
        else f"components for {', '.join(kinds)}, which fit together",
        "api": f"({API[0]}, {API[1]})",
        "kind": kind,
        "import_effort": "    EFFORT,\n" if kind == "effort" else "",
        "import_velocity": "    VELOCITY,\n" if kind == "velocity" else "",
        "command": command,
        "checks": checks,
        "needs": "".join(f', "{need}"' for need in needs),
        "tests": ", ".join(f'"{test}"' for test in tests),
        "core": f"graspsense>={major}.{minor},<{major}.{minor + 1}",
        "imports": "".join(f"    {name},\n" for name in (*sorted(entries), "hookimpl")),
    }
    words["first"] = "\n    ".join(_first(kinds, {**words, "scene": "scene.toml"}))
    return words


def plugin_module(roles: Sequence[str], words: Mapping[str, str]) -> str:
    """Return the text of `plugin.py`: the hooks of these roles."""
    kinds = _kinds(roles)
    hooks = [
        _entry_hook(role, kind, words) if kind.entry else _filled(f"{role}/hook.py.txt", words)
        for role, kind in kinds.items()
    ]
    if _together(kinds):
        hooks.append(_entry_hook("pipeline", PIPELINE, words))
    return _filled("plugin.py.txt", {**words, "hooks": "".join(hooks).rstrip()})


def _entry_hook(role: str, kind: ScaffoldKind, words: Mapping[str, str]) -> str:
    """Return the hook that returns the entry of a component."""
    declared = {name: Template(getattr(kind, name)).substitute(words) for name in ("declares", "summary")}
    hook = f"{role.replace('-', '_')}s"
    return _filled("entry_hook.py.txt", {**words, **declared, "entry": kind.entry, "hook": hook})


def _kinds(roles: Sequence[str]) -> dict[str, ScaffoldKind]:
    """Return the kinds of these roles, in the order of `KINDS`. Raises ConfigError."""
    for role in roles:
        if role not in KINDS:
            raise ConfigError(
                f"no role {role!r}.{suggestion(role, KINDS)} There are:\n"
                + "\n".join(f"  {known:<15} {kind.does}" for known, kind in KINDS.items())
            )
        if roles.count(role) > 1:
            raise ConfigError(f"--role {role} is given {roles.count(role)} times: give each role once")
    return {role: kind for role, kind in KINDS.items() if role in roles}


def _together(kinds: Mapping[str, ScaffoldKind]) -> bool:
    """Return whether the package ships a pipeline, which it does if a pipeline can select several of its parts."""
    return len(kinds.keys() & TABLE_OF_ROLE) > 1


def _first(kinds: Mapping[str, ScaffoldKind], words: Mapping[str, str]) -> list[str]:
    """Return the first commands to try."""
    apart = [kind for role, kind in kinds.items() if role not in TABLE_OF_ROLE or not _together(kinds)]
    commands = [Template(kind.first_command).substitute(words) for kind in apart]
    if _together(kinds):
        commands.insert(0, f"graspsense run --pipeline {words['part']}")
    return list(dict.fromkeys(commands))


def _pipeline(kinds: Mapping[str, ScaffoldKind], words: Mapping[str, str]) -> str:
    """Return the pipeline that selects every component of the package."""
    lines = [
        f"# The parts of {words['name']} together; what is not given here is as in the default pipeline."
    ]
    lines.append('extends = "default"')
    for role, table in TABLE_OF_ROLE.items():
        if role in kinds and role != "classifier":
            lines += ["", f"[{table}]", f'type = "{words["name"]}/{words["part"]}"']
    lines += ["", "[classifier]"]
    if "classifier" in kinds:
        lines.append(
            f'# type = "{words["name"]}/{words["part"]}" and model = "model.json", once one is trained:'
        )
        lines.append(f"# graspsense train SOURCE --classifier {words['part']} --out model.json")
    else:
        lines.append("# The model of the default pipeline was trained with other grippers and features.")
    return "\n".join([*lines, 'type = "none"', ""])


def _texts(kinds: Mapping[str, ScaffoldKind], words: Mapping[str, str]) -> dict[str, str]:
    """Return the path of each file to be made, and its text."""
    package = f"src/{words['package']}"
    texts = {name: _filled(f"{name.rpartition('/')[2].lstrip('.')}.txt", words) for name in COMMON}
    texts[f"{package}/__init__.py"] = _filled("init.py.txt", words)
    texts[f"{package}/plugin.py"] = plugin_module(tuple(kinds), words)
    for role, kind in kinds.items():
        texts[f"{package}/{kind.module}.py"] = _filled(f"{role}/{kind.module}.py.txt", words)
        texts[f"tests/test_{kind.module}.py"] = _filled(f"{role}/test_{kind.module}.py.txt", words)
    if _together(kinds):
        texts[f"{package}/pipelines/{words['part']}.toml"] = _pipeline(kinds, words)
        texts["tests/test_pipeline.py"] = _filled("test_pipeline.py.txt", words)
    if "sim-term" in kinds:
        texts["scene.toml"] = _filled("sim-term/scene.toml.txt", words)
    return texts


def _filled(template: str, words: Mapping[str, str]) -> str:
    """Return a template with its placeholders filled."""
    text = files("graspsense.scaffold").joinpath("templates").joinpath(template).read_text(encoding="utf-8")
    return Template(text).substitute(words)


def _check_importable(name: str) -> None:
    """Refuse a name whose package exists in another distribution or in Python. Raises ConfigError."""
    package = name.replace("-", "_")
    if keyword.iskeyword(package):
        raise ConfigError(f"the name {name!r} is not valid: {package} is a keyword of Python")
    ours = (DISTRIBUTION, *(shipped.distribution for shipped in (*SHIPPED, *EXAMPLES)))
    if name in ours:
        raise ConfigError(
            f"the name {name!r} is taken: graspsense itself has it. Choose another name, as lab-hand"
        )
    if package in sys.stdlib_module_names:
        raise ConfigError(f"the name {name!r} is taken: Python itself has a module {package}")
    if package not in sys.modules and find_spec(package) is None:
        # Asking which distribution has it reads the lists of the files of all, which takes half a second.
        return
    plugins = {source.distribution for source in installed_sources()}
    others = [
        distribution
        for distribution in packages_distributions().get(package, ())
        if canonical(distribution) not in {name} & plugins
    ]
    if others:
        raise ConfigError(
            f"the name {name!r} is taken: {others[0]} has a package {package}, which this one would hide. Choose "
            f"another name, as lab-{name}"
        )
