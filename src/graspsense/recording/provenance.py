"""Provenance of a trial besides its settings: versions, the commit of the code, and the machine."""

from __future__ import annotations

import hashlib
import platform
from collections.abc import Mapping
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any, Final

from graspsense import __version__
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.json_values import json_text
from graspsense.recording.checkout import checkout_state

_WITH: Final = ("numpy", "scikit-learn", "mcap")


def provenance(settings: Settings) -> dict[str, Any]:
    """Return the hash of the settings, component and library versions, the commit, and the machine."""
    return {
        "config_sha256": json_sha256(settings.values),
        "components": dict(settings.components),
        "seed": settings.run.seed,
        **process_provenance(),
    }


def json_sha256(values: Any) -> str:
    """Return a hash of values, such as resolved settings, equal for equal ones."""
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
    code, work = checkout_state(Path(__file__).parent), checkout_state(Path.cwd())
    return {
        "graspsense": __version__,
        "python": platform.python_version(),
        "libraries": {name: _version(name) for name in _WITH},
        "host": platform.node(),
        "system": f"{platform.system()} {platform.release()} {platform.machine()}",
        "git": {"graspsense": code, "here": work},
    }


def commit_text(made: Mapping[str, Any]) -> str:
    """Return the commit of graspsense's code in a provenance, and whether its files had changes, as text."""
    git = (made.get("git") or {}).get("graspsense") or {}
    if not git.get("commit"):
        return "unknown"
    dirty = git.get("dirty")
    changes = " (changes unknown)" if dirty is None else " (with changes)" if dirty else ""
    return f"{str(git['commit'])[:12]}{changes}"


def _version(name: str) -> str | None:
    try:
        return version(name)
    except PackageNotFoundError:
        return None
