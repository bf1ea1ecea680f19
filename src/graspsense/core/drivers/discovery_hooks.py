"""The hooks by which a plugin finds and examines its grippers, in a module that is imported when they are called."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from importlib import import_module

from graspsense.core.components.entries import Finding, FoundDevice
from graspsense.core.components.hookspecs import hookimpl


def discovery_hooks(
    module: str,
) -> tuple[Callable[[float], Iterable[FoundDevice]], Callable[[object, float], Iterable[Finding]]]:
    """Return `graspsense_probe_devices` and `graspsense_diagnose`, by two functions of this module.

    `found_devices(timeout_s)` lists the grippers that there are, and `diagnose(config, timeout_s)` yields the findings
    about that of these settings, or without settings about any.
    """

    @hookimpl
    def graspsense_probe_devices(timeout_s: float) -> Iterable[FoundDevice]:
        devices: Iterable[FoundDevice] = import_module(module).found_devices(timeout_s)
        return devices

    @hookimpl
    def graspsense_diagnose(config: object, timeout_s: float) -> Iterable[Finding]:
        findings: Iterable[Finding] = import_module(module).diagnose(config, timeout_s)
        return findings

    return graspsense_probe_devices, graspsense_diagnose
