"""Which plugins are installed, and which of them may be loaded. Nothing is imported here."""

from __future__ import annotations

import importlib
import json
import os
import re
from collections.abc import Callable, Iterable, Mapping
from functools import partial
from importlib.metadata import Distribution, EntryPoint, distributions
from pathlib import Path
from typing import Final

from attrs import define

from graspsense import __version__
from graspsense.core.components.firstparty import BUILTIN_MODULE, DISTRIBUTION
from graspsense.core.components.hookspecs import ENTRY_POINT_GROUP
from graspsense.core.components.registry.parts import canonical
from graspsense.core.files.toml_text import labelled_values, settings_text
from graspsense.core.files.user_folders import NOWHERE, config_folder
from graspsense.core.files.whole_file import write_whole
from graspsense.core.values.errors import ConfigError, suggestion

ALLOWED_VARIABLE: Final = "GRASPSENSE_PLUGINS"
"""If this environment variable is set, only the distributions that it lists are loaded."""
DISABLED_VARIABLE: Final = "GRASPSENSE_DISABLED_PLUGINS"
ENTRY_POINT: Final = (
    f'name its module in its pyproject.toml, under [project.entry-points."{ENTRY_POINT_GROUP}"], as in '
    'lab-hand = "lab_hand.plugin", and install it again'
)


class PluginRefused(Exception):
    """A plugin that breaks a rule; its text is the reason."""


@define
class PluginSource:
    """A plugin before it is loaded: its distribution, and the function that imports it."""

    distribution: str
    version: str
    entry_point: str
    module: str
    load: Callable[[], object]
    copies: tuple[str, ...] = ()
    """Version and folder of each copy if the distribution is installed more than once."""


def builtin_source() -> PluginSource:
    """Return the plugin that is part of this distribution."""
    return PluginSource(
        DISTRIBUTION, __version__, "builtin", BUILTIN_MODULE, lambda: importlib.import_module(BUILTIN_MODULE)
    )


def installed_sources() -> list[PluginSource]:
    """Return every entry point of the group `graspsense.plugins`, sorted and without duplicates."""
    sources: dict[tuple[str, str], PluginSource] = {}
    places: dict[tuple[str, str], dict[str, str]] = {}
    for distribution in distributions():
        for source in _sources_of(distribution):
            key = (source.distribution, source.entry_point)
            sources.setdefault(key, source)
            # The real path, because lib64 can be a link to lib.
            place = os.path.realpath(str(getattr(distribution, "_path", "")))
            places.setdefault(key, {})[place] = f"{source.version} in {os.path.dirname(place)}"
    for key, copies in places.items():
        if len(copies) > 1:
            sources[key].copies = tuple(copies.values())
    return [sources[key] for key in sorted(sources)]


def reason_not_to_load(distribution: str, environ: Mapping[str, str], disabled: set[str]) -> str:
    """Return why the plugins of this distribution must not be loaded; empty if they may be."""
    if distribution == DISTRIBUTION:
        return ""
    allowed = environ.get(ALLOWED_VARIABLE)
    if allowed is not None and distribution not in _names(allowed):
        return f"not in {ALLOWED_VARIABLE}"
    if distribution in _names(environ.get(DISABLED_VARIABLE, "")):
        return f"in {DISABLED_VARIABLE}"
    if distribution in disabled:
        return f"in {config_file()} (graspsense plugins enable {distribution})"
    return ""


def config_file() -> Path | None:
    """Return the file with the disabled plugins, whether or not it exists; None for a user without a home folder."""
    folder = config_folder()
    return None if folder is None else folder / "plugins.toml"


def disabled_in_config() -> tuple[str, ...]:
    """Return the distributions listed under `disabled`, as they are written there.

    Raises ConfigError if the file is not `disabled = ["NAME", ...]`.
    """
    path = config_file()
    if path is None or not _is_there(path):
        return ()
    label = str(path)
    try:
        values = labelled_values(settings_text(path, label, "plugins"), label)
    except ConfigError as error:
        raise ConfigError(
            f'{error}. It holds one line, disabled = ["NAME", ...]: correct it, or set XDG_CONFIG_HOME to another '
            f"folder than {path.parent.parent}"
        ) from error
    names = values.pop("disabled", [])
    if values or not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        what = f"the unknown key {next(iter(values))!r}" if values else f"disabled = {names!r}"
        raise ConfigError(f'{path}: found {what}. It holds one line, disabled = ["NAME", ...]')
    return tuple(names)


def _is_there(path: Path) -> bool:
    """Return whether there is such a file; also if that cannot be told, which its reader then says."""
    try:
        return path.exists()
    except OSError:
        return True


def write_disabled(names: Iterable[str]) -> Path:
    """Write the list and return its file; an empty list removes it. Raises ConfigError without a home folder."""
    path, wanted = config_file(), sorted(set(names))
    if path is None:
        raise ConfigError(NOWHERE.format("XDG_CONFIG_HOME"))
    if not wanted:
        path.unlink(missing_ok=True)
        return path
    path.parent.mkdir(parents=True, exist_ok=True)
    write_whole(path, f"disabled = {json.dumps(wanted)}\n".encode())
    return path


def unknown_names(installed: set[str], environ: Mapping[str, str]) -> tuple[str, ...]:
    """Return a sentence for each name in an environment variable that no installed distribution with plugins has."""
    return tuple(
        f"{variable} names {name}, and no plugin of that distribution is installed.{suggestion(name, installed)}"
        for variable in (ALLOWED_VARIABLE, DISABLED_VARIABLE)
        for name in sorted(_names(environ.get(variable, "")) - installed)
    )


def _sources_of(distribution: Distribution) -> list[PluginSource]:
    text = distribution.read_text("entry_points.txt") or ""
    if ENTRY_POINT_GROUP not in text:
        return []  # most distributions: no metadata has to be parsed
    name, version = _name_and_version(distribution)
    try:
        entry_points = distribution.entry_points.select(group=ENTRY_POINT_GROUP)
    except Exception as error:
        reason = f"its entry points cannot be read ({error}): {ENTRY_POINT}"
        return [PluginSource(name, version, "?", "entry_points.txt", partial(_refused, reason))]
    return [
        PluginSource(name, version, point.name, point.value, partial(_loaded, point))
        for point in entry_points
    ]


def _loaded(point: EntryPoint) -> object:
    """Return what an entry point names. Raises PluginRefused where its module is not there, whatever that raises."""
    module = point.value.partition(":")[0].strip()
    if not re.fullmatch(r"[\w.]+", module):
        raise PluginRefused(f"its entry point names {point.value!r}, which is no module: {ENTRY_POINT}")
    try:
        return point.load()
    except ModuleNotFoundError as error:
        if not f"{module}.".startswith(f"{error.name}."):
            raise
    raise PluginRefused(f"its entry point names the module {module!r}, which is not there: {ENTRY_POINT}")


def _name_and_version(distribution: Distribution) -> tuple[str, str]:
    """Return the canonical name and the version, from the name of the folder if the metadata lacks them."""
    metadata = distribution.metadata
    folder = str(getattr(distribution, "_path", "unknown")).replace("\\", "/").rpartition("/")[2]
    name, _, version = folder.rpartition(".")[0].partition("-")
    return canonical(metadata["Name"] or name), metadata["Version"] or version or "?"


def _refused(reason: str) -> object:
    raise PluginRefused(reason)


def _names(text: str) -> set[str]:
    return {canonical(name) for name in re.split(r"[,\s]+", text) if name}
