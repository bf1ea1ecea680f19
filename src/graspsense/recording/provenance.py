"""Provenance of a trial besides its settings: versions, the commit of the code, and the machine."""

from __future__ import annotations

import hashlib
import os
import platform
import subprocess
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from graspsense import __version__
from graspsense.core.json_values import json_text

if TYPE_CHECKING:
    from graspsense.core.config import Settings

GIT_S: Final = 2.0
_WITH: Final = ("numpy", "scikit-learn", "mcap")


def provenance(settings: Settings) -> dict[str, Any]:
    """Return the hash of the settings, component and library versions, the commit, and the machine."""
    return {
        "config_sha256": config_sha256(settings.values),
        "components": dict(settings.components),
        "seed": settings.run.seed,
        **process_provenance(),
    }


def config_sha256(values: Mapping[str, Any]) -> str:
    """Return a hash of resolved settings, equal for equal settings."""
    return hashlib.sha256(json_text(values).encode()).hexdigest()


PER_GRASP: Final = (("gripper", "object"), ("gripper", "recording"), ("run", "seed"))
"""Settings that differ between the grasps of one experiment."""


def recipe(values: Mapping[str, Mapping[str, Any]]) -> dict[str, dict[str, Any]]:
    """Return the settings that affect measurements: without `PER_GRASP`, the classifier, and keys that are not set."""
    return {
        table: {
            key: value for key, value in keys.items() if value is not None and (table, key) not in PER_GRASP
        }
        for table, keys in values.items()
        if table != "classifier"
    }


@cache
def process_provenance() -> Mapping[str, Any]:
    """Return library versions, the commits of the code and of the current folder, and the machine."""
    code, work = _commit(Path(__file__).parent), _commit(Path.cwd())
    return {
        "graspsense": __version__,
        "python": platform.python_version(),
        "libraries": {name: _version(name) for name in _WITH},
        "host": platform.node(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "git": {"graspsense": code, "here": work},
    }


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None


def _commit(folder: Path) -> dict[str, Any] | None:
    """Return commit and dirty flag of the checkout that contains this folder, or None."""
    commit = _git(folder, "rev-parse", "HEAD")
    if commit is None:
        return None
    # Ignored and untracked files are not part of the code that ran.
    changed = _git(folder, "status", "--porcelain", "--untracked-files=no")
    return {"commit": commit, "dirty": None if changed is None else bool(changed)}


def _git(folder: Path, *arguments: str) -> str | None:
    # The configuration of a checkout may name programs to run; disable those that `status` would run.
    command = ["git", "-c", "core.fsmonitor=false", "-c", "core.hooksPath=/dev/null", "-C", str(folder)]
    try:
        done = subprocess.run(
            [*command, *arguments],
            capture_output=True,
            text=True,
            timeout=GIT_S,
            env={**os.environ, "GIT_OPTIONAL_LOCKS": "0", "LC_ALL": "C"},
            check=False,
        )
    except (OSError, subprocess.TimeoutExpired):
        return None
    return done.stdout.strip() if done.returncode == 0 else None
