"""The folder in which compiled code is kept from one process to the next."""

from __future__ import annotations

import functools
import os
from contextlib import suppress
from pathlib import Path
from typing import Final

from graspsense.core.user_folders import cache_folder

MAX_FILES: Final = 2000
"""Number of files from which on the older half is deleted. A compiled function has two files, of 10 kB to 1 MB."""


@functools.cache
def compiled_code_folder() -> Path | None:
    """Return the folder of this user for compiled code, made and swept once a process; None where it cannot be written.

    An installed package may not be writable, hence a folder of the user's.
    """
    parent = cache_folder()
    if parent is None:
        return None
    folder = parent / "compiled"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return None
    if not os.access(folder, os.W_OK | os.X_OK):
        return None
    delete_older_half(folder, MAX_FILES)
    return folder


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
