"""The versions that a process uses, and the differences between two processes."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from datetime import date
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from graspsense import __version__
from graspsense.core.components.registry import installed

_LIBRARIES: Final = ("numpy", "scipy", "scikit-learn", "numba")


@cache
def versions() -> Mapping[str, str]:
    """Return the versions that a result may depend on: Python, libraries, plugins, processor."""
    versions_here = {
        "python": platform.python_version(),
        "graspsense": __version__,
        "machine": platform.machine(),
    }
    for name in _LIBRARIES:
        try:
            versions_here[name] = version(name)
        except PackageNotFoundError:
            versions_here[name] = "not installed"
    for status in installed().statuses:
        versions_here[status.distribution] = (
            status.version if status.state == "loaded" else f"{status.version} ({status.state})"
        )
    return versions_here


def measured_on() -> dict[str, str]:
    """Return when and where a time is measured: date, processor, system, load, and `versions`."""
    return {
        "date": date.today().isoformat(),
        "processor": platform.processor() or platform.machine(),
        "system": f"{platform.system()} {platform.release()}",
        "load": f"{os.getloadavg()[0]:.1f} on {os.cpu_count()} cores",
        **versions(),
    }


def where_measured() -> str:
    """Return `measured_on` as text."""
    return ", ".join(f"{key} {value}" for key, value in measured_on().items())


def differences(here: Mapping[str, str], there: Mapping[str, str]) -> list[str]:
    """Return the differences between two processes, in words."""
    return [
        f"{name}: {here.get(name, 'not installed')} here, {there.get(name, 'not installed')} there"
        for name in sorted(here.keys() | there.keys())
        if here.get(name, "not installed") != there.get(name, "not installed")
    ]
