"""The folders of the user for settings, data and caches. A user without a home folder has none."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Final

NOWHERE: Final = "this user has no home directory: set HOME or {}, the folder to keep it in"


def config_folder() -> Path | None:
    """Return the folder for settings, whether or not it exists; None for a user without a home folder."""
    return _folder("XDG_CONFIG_HOME", ".config")


def data_folder() -> Path | None:
    """Return the folder for data, whether or not it exists; None for a user without a home folder."""
    return _folder("XDG_DATA_HOME", ".local", "share")


def cache_folder() -> Path | None:
    """Return the folder for caches, whether or not it exists; None for a user without a home folder."""
    # The temporary folder of the system is no substitute: other users could put code there.
    return _folder("XDG_CACHE_HOME", ".cache")


def _folder(variable: str, *beside: str) -> Path | None:
    given = os.environ.get(variable)
    # A relative one counts as not set, as the standard says: it would be another folder wherever the user stands.
    if given and os.path.isabs(given):
        return Path(given) / "graspsense"
    try:
        return Path.home().joinpath(*beside, "graspsense")
    except RuntimeError:
        # There is neither HOME nor an entry in the list of users, as in some containers.
        return None
