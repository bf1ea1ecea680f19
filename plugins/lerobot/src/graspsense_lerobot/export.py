"""`graspsense export DIR --to lerobot:FOLDER`: trials as a new data set, or in a copy of the one they are from."""

from __future__ import annotations

import os
import secrets
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from graspsense.gripper_api import SaveFailed, StoredGrasp
from graspsense.plugin_api import ConfigError
from graspsense_lerobot.annotate import annotate
from graspsense_lerobot.place import folder_and_options
from graspsense_lerobot.writer import write_data_set


def export(grasps: Sequence[StoredGrasp], place: str) -> dict[str, int]:
    """Write trials to a new folder, or to a copy of their data set, and return how many trials and frames it has.

    Raises ConfigError if it exists or a trial cannot be an episode, SaveFailed if it cannot be written.
    """
    folder, options = folder_and_options(place)
    with _new_folder(folder) as part:
        if options.annotate:
            return annotate(grasps, Path(os.path.expanduser(options.annotate)), part)
        return write_data_set(grasps, options.fps, part)


@contextmanager
def _new_folder(folder: Path) -> Iterator[Path]:
    """Give a folder to write to, which gets its name when all is written. Raises ConfigError, SaveFailed."""
    if os.path.lexists(folder):
        raise ConfigError(f"{folder} already exists: name another folder, or move it away")
    part = folder.with_name(f"{folder.name}.{secrets.token_hex(8)}.part")
    try:
        part.mkdir(parents=True)
        yield part
        part.rename(folder)
    except OSError as error:
        raise SaveFailed(f"{folder} cannot be written: {error.strerror or error}") from error
    finally:
        shutil.rmtree(part, ignore_errors=True)
