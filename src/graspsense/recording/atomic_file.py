"""Writing a file completely or not at all."""

from __future__ import annotations

import os
from pathlib import Path

from graspsense.core.errors import ConfigError, GraspsenseError


class SaveFailed(GraspsenseError):
    """Data could not be written to the disk."""

    exit_code = 2


def write_new(path: Path, data: bytes) -> None:
    """Write a new file. Raises ConfigError if it already exists, SaveFailed if it cannot be written."""
    if path.exists():
        raise ConfigError(f"{path} already exists: name another file, or move it away")
    write_or_replace(path, data)


def write_or_replace(path: Path, data: bytes, *, make_folder: bool = False) -> None:
    """Write a file, or replace an existing one; when this returns, the data is on the disk.

    `make_folder` creates the folder of the file if it does not exist. Raises SaveFailed.
    """
    part = path.with_name(path.name + ".part")
    try:
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
        sync_folder(path.parent)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error


def sync_folder(folder: Path) -> None:
    """Wait until the disk has the folder's entries, so that a new name survives a loss of power. Raises OSError."""
    fd = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)
