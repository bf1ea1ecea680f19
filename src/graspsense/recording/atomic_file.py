"""Writing a file of the user's completely or not at all, with an error that says which file and why."""

from __future__ import annotations

from pathlib import Path

from graspsense.core.files.whole_file import write_whole
from graspsense.core.values.errors import ConfigError, ExitCode, GraspsenseError


class SaveFailed(GraspsenseError):
    """Data could not be written to the disk."""

    exit_code = ExitCode.WRONG_USE


def write_new(path: Path, data: bytes) -> None:
    """Write a new file. Raises ConfigError if it already exists, SaveFailed if it cannot be written."""
    try:
        write_whole(path, data, replace=False)
    except FileExistsError:
        raise ConfigError(f"{path} already exists: name another file, or move it away") from None
    except OSError as error:
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error


def write_or_replace(path: Path, data: bytes, *, make_folder: bool = False) -> None:
    """Write a file, or replace an existing one; when this returns, the data is on the disk.

    `make_folder` creates the folder of the file if it does not exist. Raises SaveFailed.
    """
    try:
        if make_folder:
            path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, data)
    except OSError as error:
        raise SaveFailed(f"{path} cannot be written: {error.strerror}") from error
