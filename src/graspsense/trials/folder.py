"""A trial kept as a folder: its trace, what was printed of it, and the settings that run it again."""

from __future__ import annotations

import json
import os
from pathlib import Path

import numpy as np

from graspsense.core.errors import GraspsenseError
from graspsense.core.trace import PAD_COLUMNS, TICK_COLUMNS
from graspsense.core.trial import Trial, trial_as_json


class NotKept(GraspsenseError):
    """A trial that could not be written where it was to be kept."""

    exit_code = 2


def new_trial_folder(parent: str | Path) -> Path:
    """Make and return the next free folder `trial-0001` below `parent`, before the grasp, so that none is lost.

    Raises NotKept where it cannot be made.
    """
    parent = Path(parent)
    try:
        parent.mkdir(parents=True, exist_ok=True)
        taken = [int(p.name[6:]) for p in parent.glob("trial-*") if p.name[6:].isdigit()]
        folder = parent / f"trial-{max(taken, default=0) + 1:04d}"
        folder.mkdir()
    except OSError as error:
        raise NotKept(
            f"cannot keep a trial below {parent}: {error.strerror}. Name a folder to write in"
        ) from error
    return folder


def keep(folder: Path, trial: Trial, settings_toml: str) -> None:
    """Write `settings.toml`, `trial.json` and `trace.npz` into `folder`, each whole or not at all.

    Raises NotKept where the disk is full or the folder cannot be written.
    """
    try:
        _write(folder / "settings.toml", settings_toml.encode())
        _write(folder / "trial.json", json.dumps(trial_as_json(trial), indent=2).encode())
        columns = {name: getattr(trial.trace, name) for name in (*TICK_COLUMNS, *PAD_COLUMNS)}
        part = folder / "trace.npz.part"
        with part.open("wb") as file:
            np.savez_compressed(file, **columns)
            file.flush()
            os.fsync(file.fileno())
        part.replace(folder / "trace.npz")
    except OSError as error:
        raise NotKept(f"the trial could not be kept in {folder}: {error.strerror}") from error


def _write(path: Path, data: bytes) -> None:
    part = path.with_name(path.name + ".part")
    with part.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
    part.replace(path)
