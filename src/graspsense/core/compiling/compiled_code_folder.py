"""The folder in which compiled code is kept from one process to the next."""

from __future__ import annotations

import functools
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from graspsense.core.files.user_folders import cache_folder, is_closed, make_closed

_CONTENT: Final = "files with compiled code"
MAX_FILES: Final = 2000
"""Number of files from which on the older half is deleted. A compiled function has two files, of 10 kB to 1 MB."""


@functools.cache
def compiled_code_folder() -> Path | None:
    """Return the folder for compiled code, made and swept once a process; None where there is none that can be used.

    It is in the one that NUMBA_CACHE_DIR names, or else one of the user's, since an installed package may not be
    writable. Compiled code is run as it is found: a folder in which another user could have put something is not used.
    """
    given = os.environ.get("NUMBA_CACHE_DIR")
    if given and _is_usable(Path(given)):
        return _closed(Path(given).absolute() / "graspsense")
    parent = cache_folder()
    if parent is None or not _is_usable(parent / "compiled"):
        return None
    delete_older_half(parent / "compiled", MAX_FILES)
    return _closed(parent / "compiled")


def _closed(folder: Path) -> Path | None:
    """Return the folder, or None where another user could have put something into it."""
    if not _is_usable(folder):
        return None
    with suppress(OSError):
        return folder if all(is_closed(path, _CONTENT) for path in folder.iterdir()) else None
    return None


def _is_usable(folder: Path) -> bool:
    try:
        make_closed(folder)
    except OSError:
        return False
    return os.access(folder, os.W_OK | os.X_OK) and is_closed(folder, _CONTENT)


def delete_older_half(folder: Path, max_files: int) -> None:
    """Delete the older half of the files below `folder`, by time of last change, where there are `max_files` or more.

    A process that still lists a deleted file finds it missing and compiles the function anew.
    """
    # Other processes delete here too.
    with suppress(OSError):
        files = [path for path in folder.rglob("*") if path.is_file()]
        if len(files) < max_files:
            return
        for path in sorted(files, key=lambda path: path.stat().st_mtime)[: len(files) // 2]:
            path.unlink(missing_ok=True)
