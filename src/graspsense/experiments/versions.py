"""The versions that a process uses, and the differences between two processes."""

from __future__ import annotations

import os
import platform
from collections.abc import Mapping
from datetime import date
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from typing import Final

from graspsense.core.components.registry import installed
from graspsense.sources.input_content import FRAMEWORK, developed_code, required_by

_LIBRARIES: Final = ("numpy", "scipy", "scikit-learn", "numba")


@cache
def versions() -> Mapping[str, str]:
    """Return the versions that a result may depend on: Python, libraries, plugins and what these need, processor.

    To the version of a distribution that is developed here, a hash of its code is added: `0.1.0+1f3a9c0e`.
    """
    versions_here = {"python": platform.python_version(), "machine": platform.machine()}
    libraries = set(_LIBRARIES)
    for status in installed().statuses:
        code = developed_code(status.module)[:8]
        words = f"{status.version}+{code}" if code else status.version
        if status.state == "loaded" and status.distribution != FRAMEWORK:
            libraries |= required_by(status.distribution)
        versions_here[status.distribution] = (
            words if status.state == "loaded" else f"{words} ({status.state})"
        )
    for name in sorted(libraries - versions_here.keys()):
        try:
            versions_here[name] = version(name)
        except PackageNotFoundError:
            versions_here[name] = "not installed"
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
