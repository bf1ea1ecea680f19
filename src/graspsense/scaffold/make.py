"""Writes the package of a new plugin from the templates in this folder."""

from __future__ import annotations

import keyword
import re
import sys
from collections.abc import Mapping
from importlib.metadata import packages_distributions
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Final

from attrs import frozen

from graspsense import __version__
from graspsense.core.entries import Role
from graspsense.core.errors import ConfigError, suggestion
from graspsense.core.hookspecs import API
from graspsense.core.plugins import canonical, installed, installed_sources


@frozen
class ScaffoldKind:
    """The package for one role: the module of the component, and the first command to try."""

    role: Role | None
    module: str
    does: str
    suffix: str
    """Ending of the name of the class."""
    needs: tuple[str, ...]
    first: str


KINDS: Final[Mapping[str, ScaffoldKind]] = {
    "sensor-backend": ScaffoldKind(
        "sensor-backend",
        "backend",
        "a gripper, here a fake one behind the place where its driver goes",
        "Gripper",
        (),
        "graspsense run --gripper $part",
    ),
    "controller": ScaffoldKind(
        "controller",
        "law",
        "a control law that closes until the fingers rest",
        "Controller",
        (),
        "graspsense run -o controller.type=$part",
    ),
    "feature-set": ScaffoldKind(
        "feature-set",
        "features",
        "features of a grasp",
        "Features",
        ("numpy>=1.26",),
        "graspsense run -o features.type=$part -o classifier.type=none",
    ),
    "classifier": ScaffoldKind(
        "classifier",
        "classifier",
        "a classifier",
        "Classifier",
        ("numpy>=1.26",),
        "graspsense evaluate simulated --classifier $part",
    ),
    "sim-term": ScaffoldKind(
        None,
        "term",
        "a term of the simulator: a part of an object's force",
        "",
        ("graspsense-sim-gripper>=0.1,<0.2",),
        "graspsense run --object scene.toml -o classifier.type=none",
    ),
    "observer": ScaffoldKind(
        None, "observer", "an observer that logs how each grasp ended", "", (), "graspsense run"
    ),
}
"""The packages that `plugins new` can make, by the value of `--role`."""

COMMON: Final = ("pyproject.toml", "README.md", ".gitignore", "tests/test_conformance.py")
NAME: Final = re.compile(r"[a-z][a-z0-9]*(-[a-z0-9]+)*")


def make(name: str, role: str, folder: Path) -> list[str]:
    """Write the package `name` to `folder` and return the next steps, one in each line.

    Raises ConfigError for an unknown role, an invalid name, or a folder that is not empty.
    """
    kind = KINDS.get(role)
    if kind is None:
        raise ConfigError(
            f"no role {role!r}. There are:\n"
            + "\n".join(f"  {one:<15} {what.does}" for one, what in KINDS.items())
            + suggestion(role, KINDS)
        )
    if not NAME.fullmatch(name):
        raise ConfigError(
            f"the name {name!r} will not do: small letters, digits and single hyphens, a letter first, as in lab-hand"
        )
    part = name.removeprefix("graspsense-")
    _check_importable(name)
    _check_free(kind, part, name)
    if folder.exists() and (not folder.is_dir() or any(folder.iterdir())):
        raise ConfigError(f"{folder} is there already: give another name, or --folder")
    words = {
        "name": name,
        "part": part,
        "package": name.replace("-", "_"),
        "term": part.replace("-", "_"),
        "Class": "".join(word.capitalize() for word in part.split("-")) + kind.suffix,
        "does": kind.does,
        "api": f"({API[0]}, {API[1]})",
        "role": role,
        "needs": "".join(f', "{one}"' for one in kind.needs),
        "core": _compatible(__version__),
    }
    words["first"] = Template(kind.first).substitute(words)
    templates = files("graspsense.scaffold").joinpath("templates")
    for target, source in _files(kind, role, words).items():
        text = templates.joinpath(source).read_text(encoding="utf-8")
        path = folder / target
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(Template(text).substitute(words), encoding="utf-8")
    (folder / "src" / words["package"] / "py.typed").touch()
    return [
        f"{folder} is {kind.does}: src/{words['package']}/{kind.module}.py",
        f"  pip install -e {folder if folder.is_absolute() else f'./{folder}'} pytest",
        "  graspsense plugins list",
        f"  graspsense plugins check {name}",
        f"  pytest {folder}",
        f"  {words['first']}",
    ]


def _files(kind: ScaffoldKind, role: str, words: Mapping[str, str]) -> dict[str, str]:
    """Return the path of each file to be made and the template it is made from."""
    package = f"src/{words['package']}"
    found = {name: f"{name.rpartition('/')[2].lstrip('.')}.txt" for name in COMMON}
    found[f"{package}/__init__.py"] = "init.py.txt"
    found[f"{package}/plugin.py"] = f"{role}/plugin.py.txt"
    found[f"{package}/{kind.module}.py"] = f"{role}/{kind.module}.py.txt"
    found[f"tests/test_{kind.module}.py"] = f"{role}/test_{kind.module}.py.txt"
    if role == "sensor-backend":
        found["tests/test_conformance.py"] = f"{role}/test_conformance.py.txt"
    if role == "sim-term":
        found["scene.toml"] = f"{role}/scene.toml.txt"
    return found


def _check_importable(name: str) -> None:
    """Refuse a name whose package exists in another distribution or in Python. Raises ConfigError."""
    package = name.replace("-", "_")
    if keyword.iskeyword(package):
        raise ConfigError(f"the name {name!r} will not do: {package} is a keyword of Python")
    if package in sys.stdlib_module_names:
        raise ConfigError(f"the name {name!r} is taken: Python itself has a module {package}")
    plugins = {source.distribution for source in installed_sources()}
    others = [
        one for one in packages_distributions().get(package, ()) if canonical(one) not in {name} & plugins
    ]
    if others:
        raise ConfigError(
            f"the name {name!r} is taken: {others[0]} has a package {package}, which this one would hide. Choose "
            f"another name, as lab-{name}"
        )


def _check_free(kind: ScaffoldKind, part: str, name: str) -> None:
    if kind.role is None:
        return
    taken = [one for one in installed().components(kind.role) if one.name == part]
    for one in taken:
        if one.distribution != name:
            raise ConfigError(
                f"the {kind.role.replace('-', ' ')} name {part!r} is taken by {one.qualified}: choose another name"
            )


def _compatible(version: str) -> str:
    """Return the requirement on graspsense of a plugin written for this version: no minor version changes."""
    major, minor, *_ = version.split(".")
    return f"graspsense>={major}.{minor},<{major}.{int(minor) + 1}"
