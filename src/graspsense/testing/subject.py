"""The subject of a check: a component with the settings to check it with, or a distribution."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from importlib import import_module
from typing import Any

from attrs import asdict, define, field

from graspsense.core.components.channels import as_json, from_json
from graspsense.core.components.entries import ROLES, Feature, Role
from graspsense.core.components.registry import Component, Plugins, PluginStatus, Resource, canonical
from graspsense.core.settings.selected import build
from graspsense.testing.checks import CheckFailed
from graspsense.testing.session import Session, readings_of


@define(slots=False, eq=False, kw_only=True)
class Subject:
    """A component under check.

    `keys` are the settings to check it with, as in its table of a pipeline file. With the keys in `unplugged`, the
    gripper disappears within two seconds of use; with those in `absent`, it is not connected. Without them, the checks
    that need them are skipped.
    """

    component: Component
    keys: Mapping[str, Any] = field(factory=dict)
    unplugged: Mapping[str, Any] | None = None
    absent: Mapping[str, Any] | None = None
    kept: dict[str, Any] = field(factory=dict, init=False)
    """Values that several checks use, computed once."""

    @property
    def name(self) -> str:
        """Its qualified name."""
        return self.component.qualified

    @property
    def role(self) -> str:
        """Its role."""
        return self.component.role

    @cached_property
    def entry(self) -> Any:
        """The entry by which its plugin declares it, with what its class declares under these settings."""
        return self.component.declared(self.config())

    def config(self, **keys: Any) -> Any:
        """Return its config, checked as strictly as one from a file."""
        return build(self.component, {**self.keys, **keys})

    def create(self, **keys: Any) -> Any:
        """Return a new instance of it."""
        return self.component.create(self.config(**keys))

    @cached_property
    def session(self) -> Session:
        """Return the readings of the gripper while it is opened, closed and opened again; recorded once."""
        return readings_of(self)


@define(eq=False, kw_only=True)
class Package:
    """A distribution under check: its plugins, and everything that these declare."""

    distribution: str
    statuses: tuple[PluginStatus, ...]
    components: tuple[Component, ...]
    resources: tuple[Resource[Any], ...]
    plugins: Plugins
    builds: bool = True
    """Whether a wheel is built to check that it is complete."""
    data: Mapping[str, str] = field(factory=dict)
    """A folder of examples for each of its data sets, by name."""

    @property
    def name(self) -> str:
        """The distribution's name."""
        return self.distribution

    role = "distribution"


def elsewhere(subject: Subject, what: Callable[[Subject], str]) -> str:
    """Return what a module function gives in a fresh interpreter, at another time of the day and of other hashes."""
    code = (
        "import json, sys; given = json.load(sys.stdin); sys.path[:] = given.pop('path')"
        "; from graspsense.testing.subject import answer; answer(**given)"
    )
    entry = asdict(subject.entry, recurse=False)
    listed: dict[str, Callable[[Any], Any]] = {"requires": as_json, "features": asdict}
    entry |= {name: [plain(part) for part in entry[name]] for name, plain in listed.items() if name in entry}
    given = {"role": subject.role, "entry": entry, "keys": dict(subject.keys), "path": sys.path}
    ran = subprocess.run(
        [sys.executable, "-P", "-c", code],
        input=json.dumps({**given, "what": [what.__module__, what.__name__]}),
        env={**os.environ, "PYTHONHASHSEED": "77", "TZ": "ELSEWHERE-13"},
        capture_output=True,
        text=True,
        check=False,
    )
    if ran.returncode:
        raise CheckFailed(f"it fails in a fresh interpreter: {ran.stderr.strip()[-300:]}")
    return ran.stdout.rpartition("\n")[2]


def answer(role: Role, entry: dict[str, Any], keys: Mapping[str, Any], what: Sequence[str]) -> None:
    """Print what `elsewhere` was asked for; it made the arguments."""
    listed: dict[str, Callable[[Any], Any]] = {
        "requires": from_json,
        "features": lambda given: Feature(**given),
    }
    entry |= {name: tuple(map(made, entry[name])) for name, made in listed.items() if name in entry}
    component = Component(ROLES[role].entry(**entry), "elsewhere", "0")
    text = getattr(import_module(what[0]), what[1])(Subject(component=component, keys=keys))
    sys.stdout.write("\n" + text)


def package_of(
    distribution: str, plugins: Plugins, *, builds: bool = True, data: Mapping[str, str] | None = None
) -> Package | None:
    """Return the distribution of this name as it is installed, or None."""
    name = canonical(distribution)
    statuses = tuple(status for status in plugins.statuses if status.distribution == name)
    if not statuses:
        return None
    return Package(
        distribution=name,
        statuses=statuses,
        components=tuple(component for component in plugins.components() if component.distribution == name),
        resources=tuple(resource for resource in plugins.all_resources() if resource.distribution == name),
        plugins=plugins,
        builds=builds,
        data=dict(data or {}),
    )
