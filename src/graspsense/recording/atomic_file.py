"""Writing a file whole or not at all, and never over one that is there."""

from __future__ import annotations

import os
from pathlib import Path

from graspsense.core.errors import ConfigError
from graspsense.recording.recorder import NotKept


def write_whole(path: Path, data: bytes) -> None:
    """Write a new file. Raises ConfigError where there is one, NotKept where it cannot be written."""
    if path.exists():
        raise ConfigError(f"{path} is there already: name another file, or move it away")
    part = path.with_name(path.name + ".part")
    try:
        with part.open("wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())
        os.replace(part, path)
    except OSError as error:
        part.unlink(missing_ok=True)
        raise NotKept(f"{path} cannot be written: {error.strerror}") from error
