"""Where the user's own files are: settings, data and what can be made again. Nowhere, for a user without a home."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

NOWHERE: Final = "this user has no home directory: set HOME or {}, the folder to keep it in"


def config_folder() -> Path | None:
    """Return the folder for settings, whether or not it exists; None where there is nowhere to keep any."""
    return _folder("XDG_CONFIG_HOME", ".config")


def data_folder() -> Path | None:
    """Return the folder for data, whether or not it exists; None where there is nowhere to keep any."""
    return _folder("XDG_DATA_HOME", ".local", "share")


def cache_folder() -> Path | None:
    """Return the folder for what takes time to make and can be made again; None where it is not to be kept."""
    # Nor in the system's temporary folder, where anybody could have put what is then run.
    return _folder("XDG_CACHE_HOME", ".cache")


def _folder(variable: str, *beside: str) -> Path | None:
    given = os.environ.get(variable)
    if given:
        return Path(given) / "graspsense"
    try:
        return Path.home().joinpath(*beside, "graspsense")
    except RuntimeError:
        # Neither HOME nor an entry in the system's list of users, as in some containers.
        return None
