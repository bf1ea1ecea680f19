"""The list of plugins that the user has disabled permanently, read before any plugin is imported."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path

from graspsense.core.files.toml_text import TomlError, toml_values
from graspsense.core.files.user_folders import NOWHERE, config_folder
from graspsense.core.files.whole_file import write_whole
from graspsense.core.values.errors import ConfigError


def config_file() -> Path | None:
    """Return the file of the list, whether or not it exists; None for a user without a home folder."""
    folder = config_folder()
    return None if folder is None else folder / "plugins.toml"


def disabled_in_config() -> tuple[str, ...]:
    """Return the distributions listed under `disabled`, as they are written there.

    Raises ConfigError if the file is not `disabled = ["NAME", ...]`.
    """
    path = config_file()
    if path is None:
        return ()
    try:
        text = path.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError):
        return ()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path} cannot be read: {error}") from error
    try:
        values = toml_values(text)
    except TomlError as error:
        raise ConfigError(f'{path}: {error}. It holds one line, disabled = ["NAME", ...]') from error
    names = values.pop("disabled", [])
    if values or not isinstance(names, list) or not all(isinstance(name, str) for name in names):
        what = f"the unknown key {next(iter(values))!r}" if values else f"disabled = {names!r}"
        raise ConfigError(f'{path}: found {what}. It holds one line, disabled = ["NAME", ...]')
    return tuple(names)


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
