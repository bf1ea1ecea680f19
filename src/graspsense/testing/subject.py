"""The subject of a check: a component with the settings to check it with, or a distribution."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from functools import cached_property
from importlib import import_module
from typing import Any

from attrs import asdict, define, field

from graspsense.core.components.channels import as_json, from_json
from graspsense.core.components.entries import ROLES, Role
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
        "; from graspsense.testing.subject import answer; print('\\n' + answer(**given))"
    )
    entry = asdict(subject.entry, recurse=False)
    if "requires" in entry:  # of a feature set, whose features are not asked for
        entry |= {"requires": [*map(as_json, entry["requires"])], "features": ()}
    given = {"role": subject.role, "entry": entry, "keys": dict(subject.keys), "path": sys.path}
    given |= {"module": what.__module__, "name": what.__name__}
    return printed_afresh(code, given=json.dumps(given).encode(), PYTHONHASHSEED="77", TZ="ELSEWHERE-13")


def answer(role: Role, entry: dict[str, Any], keys: Mapping[str, Any], module: str, name: str) -> str:
    """Return what `elsewhere` was asked for; it made the arguments."""
    if "requires" in entry:
        entry |= {"requires": tuple(map(from_json, entry["requires"])), "features": ()}
    component = Component(ROLES[role].entry(**entry), "elsewhere", "0")
    text: str = getattr(import_module(module), name)(Subject(component=component, keys=keys))
    return text


def printed_afresh(code: str, *, given: bytes = b"", **environ: str) -> str:
    """Return the last line that this code prints in a fresh interpreter, which reads `given`. Raises CheckFailed."""
    ran = subprocess.run(
        [sys.executable, "-P", "-c", code],
        input=given,
        env={**os.environ, **environ},
        capture_output=True,
        check=False,
    )
    if ran.returncode or not ran.stdout:
        failed = ran.stderr.decode(errors="replace").strip()[-300:]
        raise CheckFailed(f"it fails in a fresh interpreter: {failed}")
    return ran.stdout.decode().splitlines()[-1]


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
