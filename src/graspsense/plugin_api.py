"""What every plugin may import from graspsense: 70 names, in the groups of the table below.

What few plugins need is in `graspsense.gripper_api`, `classifier_api`, `experiment_api`, `simulator_api` and
`testing_api`.

A name is imported when it is first used. The entry module of a plugin, which is all that listing plugins imports,
therefore loads neither numpy nor a driver. Type checkers read `plugin_api.pyi`, which is generated from the table below
(`core/components/lazy_names.py`).
"""

from __future__ import annotations

from typing import Any, Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Declaring what a plugin brings": {
        "core.components.hookspecs": ("hookimpl",),
        "core.components.entries": (
            "SensorBackendEntry",
            "ControllerEntry",
            "FeatureSetEntry",
            "Feature",
            "ClassifierEntry",
            "DatasetEntry",
            "PipelineEntry",
            "CommandEntry",
        ),
        "core.components.setting": ("setting", "NAMES_INPUT"),
        "core.components.config": ("create",),
    },
    "What a gripper measures": {
        "core.values.channel": ("Channel", "FastChannel", "TactileArray"),
        "core.values.device": ("DeviceInfo",),
        "core.components.roles": ("ObjectKind",),
    },
    "Signals between a gripper and a controller": {
        "core.values.signals": ("Command", "Frame", "Image", "NO_PADS", "Pads", "Reading", "Samples"),
        "core.components.channels": ("signal_type",),
    },
    "The roles": {
        "core.components.roles": (
            "SensorBackend",
            "Controller",
            "FeatureSet",
            "Classifier",
            "ClassifierConfig",
        ),
    },
    "Kinds of command, phases and outcomes as integers, for laws that are compiled": {
        "core.values.signals": (
            "EFFORT",
            "VELOCITY",
            "POSITION",
            "FORCE",
            "APPROACH",
            "SQUEEZE",
            "HOLD",
            "RUNNING",
            "STEADY",
            "NEVER_STEADY",
            "NOTHING_THERE",
            "ONE_FINGER",
        ),
        "core.control.tick": ("RELEASE",),
    },
    "Contact and rest, the same for controllers and features": {
        "core.control.contact": (
            "CONTACT_FORCE_N",
            "REST_SPEED_M_S",
            "REST_WINDOW_S",
            "RestState",
            "at_rest",
            "both_touch",
            "update_rest",
        ),
    },
    "Features and classes": {
        "core.values.features": ("Features", "FeatureTable", "Prediction", "missing"),
        "core.learn.stored_values": ("StoredValues",),
        "core.values.trace": ("Trace",),
    },
    "Readers of data sets": {
        "sources.grasp_columns": ("GraspColumns", "checked_recording"),
        "recording.labelled_recording": ("LabelledRecording", "UnreadableRecording"),
        "recording.readable": ("each_readable",),
    },
    "Observers": {
        "core.values.events": ("GraspEvent",),
        "core.values.trial": ("RunInfo", "Trial"),
    },
    "Errors": {
        "core.values.errors": (
            "ConfigError",
            "DataDamaged",
            "DeviceLost",
            "NoDevice",
            "PluginUnavailable",
            "UnknownName",
        ),
    },
}

PUBLIC: Final = LazyNames("graspsense.plugin_api", _TABLE)

__all__ = PUBLIC.names


def __getattr__(name: str) -> Any:
    # An import statement asks for __path__, of a module that is no package too.
    if name not in PUBLIC.names and not name.startswith("__"):
        from graspsense.core.components.moved_names import refuse_moved

        refuse_moved(name)
    return PUBLIC.load(name)
