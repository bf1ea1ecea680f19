"""Everything that a plugin may import from graspsense, grouped by what it is for.

A name is imported when it is first used. The entry module of a plugin, which is all that listing plugins imports,
therefore loads neither numpy nor a driver. Type checkers read `plugin_api.pyi`, which is generated from the table
below:

    python -m graspsense.plugin_api > src/graspsense/plugin_api.pyi

A test compares the two.
"""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from typing import Any, Final

_TABLE: Final[Mapping[str, Mapping[str, tuple[str, ...]]]] = {
    "Declaring what a plugin brings": {
        "hookspecs": ("hookimpl",),
        "entries": (
            "Channel",
            "ClassifierEntry",
            "CommandEntry",
            "ConformanceCheckEntry",
            "ControllerEntry",
            "DatasetEntry",
            "EmulatorEntry",
            "Feature",
            "FeatureSetEntry",
            "Finding",
            "FoundDevice",
            "ModelEntry",
            "PipelineEntry",
            "SensorBackendEntry",
        ),
        "setting_meaning": ("CHANGES_NO_RESULT", "NAMES_INPUT"),
    },
    "Signals: what passes between a gripper and a controller": {
        "signals": (
            "CELLS",
            "CHANNELS",
            "FIRST_PAD_CELL",
            "NO_PADS",
            "Command",
            "CommandKind",
            "Frame",
            "Outcome",
            "Pads",
            "Phase",
        ),
    },
    "The same kinds, phases and outcomes as plain integers, for laws that are compiled": {
        "signals": (
            "APPROACH",
            "CRUSHED",
            "EFFORT",
            "FORCE",
            "HOLD",
            "NEVER_STEADY",
            "NOTHING_THERE",
            "ONE_FINGER",
            "POSITION",
            "RUNNING",
            "SIDE_IMPACT",
            "SLIPPED",
            "SQUEEZE",
            "STEADY",
            "TOO_WIDE",
            "VELOCITY",
        ),
        "tick": ("OPENING", "RELEASE", "TARING"),
    },
    "Sensor backends": {
        "roles": ("DeviceInfo", "ObjectKind", "Reading", "SensorBackend"),
    },
    "Sensor backends that do many grasps at once": {
        "roles": ("BatchBackend", "BatchOptions", "Grasped", "SimulationVariant"),
    },
    "Emulated devices": {
        "emulated": ("EmulatedDevice",),
    },
    "Calibration: from cell counts to newtons": {
        "calibration": (
            "LoadTable",
            "edge_force",
            "load_of",
            "masked",
            "pad_force",
            "tare",
            "zero_of",
        ),
        "calibration_files": ("calibrations_of", "stored_friction", "stored_tables", "stored_zero"),
    },
    "Transmission: from motor revolutions to the gap": {
        "transmission": (
            "ScrewLinkage",
            "gap_and_rate",
            "revolutions_at",
            "screw_linkage",
            "straight_linkage",
        ),
    },
    "Controllers": {
        "roles": ("Controller", "ControllerState", "StepLaw"),
    },
    "Contact and rest, the same for controllers and features": {
        "contact": (
            "CONTACT_FORCE_N",
            "REST_SPEED_M_S",
            "REST_WINDOW_S",
            "Stillness",
            "at_rest",
            "both_touch",
            "first_rest",
            "watch",
        ),
    },
    "Feature sets": {
        "features": ("Features", "in_words", "missing"),
        "roles": ("FeatureSet",),
        "trace": ("Trace", "TraceRecorder", "trace_of"),
    },
    "Classifiers": {
        "features": ("UNKNOWN", "FeatureTable", "Prediction", "table_of"),
        "roles": ("Classifier", "ClassifierConfig"),
        "tree": ("TreeNode",),
    },
    "Data sets": {
        "labelled": ("ControlFeatures", "Labelled"),
    },
    "Observers": {
        "trial": ("GraspEvent", "RunInfo", "Trial"),
    },
    "The tick of the runner, for a backend that runs it compiled": {
        "binding": ("bind", "maker"),
        "guard": ("GuardParams", "GuardState"),
        "run_config": ("RunConfig",),
        "runner": ("ended_by_itself", "overdue", "seconds_at_most", "tick_params"),
        "tick": ("Schedule", "TickParams", "TickState", "first_state", "tick"),
    },
    "Compiling a function with all that it calls": {
        "call_graph": ("NotCompilable", "fingerprint"),
        "compiling": ("CompileOptions", "Inlining", "compile_function", "entry_point", "first_call"),
    },
    "Building other components, collecting what other plugins bring, and where to keep files": {
        "config": ("create", "recipe_of"),
        "plugins": ("collect",),
        "user_folders": ("cache_folder",),
    },
    "Errors": {
        "errors": (
            "ConfigError",
            "DataDamaged",
            "DeviceLost",
            "GraspsenseError",
            "NoDevice",
            "PluginUnavailable",
            "RecordingEnded",
            "TareRefused",
            "UnknownName",
            "suggestion",
        ),
    },
}
"""What a name is for, the module of `graspsense.core` that defines it, and the name."""

_MODULE_OF: Final = {
    name: module for modules in _TABLE.values() for module, names in modules.items() for name in names
}

__all__ = sorted(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"graspsense.core.{_MODULE_OF[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return __all__


def _stub() -> str:
    """Return the text of `plugin_api.pyi`: an import of each name, in the groups of the table."""
    lines = [
        '"""Generated from the table in plugin_api.py by `python -m graspsense.plugin_api`: change that."""'
    ]
    for purpose, modules in _TABLE.items():
        lines += ["", f"# {purpose}"]
        for module, names in modules.items():
            lines += [f"from graspsense.core.{module} import {name} as {name}" for name in names]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print(_stub(), end="")  # noqa: T201
