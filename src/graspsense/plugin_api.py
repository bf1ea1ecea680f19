"""Everything that a plugin may import from graspsense, grouped by what it is for.

A name is imported when it is first used. The entry module of a plugin, which is all that listing plugins imports,
therefore loads neither numpy nor a driver. Type checkers read `plugin_api.pyi`, which `graspsense.core.lazy_names`
generates from the table below.
"""

from __future__ import annotations

from typing import Any, Final

from graspsense.core.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
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
            "FastChannel",
            "Feature",
            "FeatureSetEntry",
            "Finding",
            "FoundDevice",
            "ModelEntry",
            "PipelineEntry",
            "SensorBackendEntry",
            "TactileArray",
        ),
        "setting": ("CHANGES_NO_RESULT", "NAMES_INPUT", "setting"),
        "toml_text": ("TomlError", "toml_values"),
        "figure_origins": ("fitted_results", "given_claims", "gives"),
    },
    "Signals: what passes between a gripper and a controller": {
        "signals": (
            "CHANNELS",
            "NO_PADS",
            "Command",
            "CommandKind",
            "Frame",
            "Image",
            "Outcome",
            "Pads",
            "Phase",
            "Reading",
            "Samples",
            "no_pads",
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
        "faults": ("StatusBit",),
        "roles": ("DeviceInfo", "ObjectKind", "SensorBackend"),
        "channels": ("no_signals", "signal_type"),
    },
    "Sensor backends that do many grasps at once": {
        "roles": ("BatchBackend", "BatchOptions", "Grasped", "SimulationVariant"),
    },
    "Sensor backends that identify an object from recorded squeezes": {
        "identification": (
            "CandidateScore",
            "Identification",
            "IdentifiedParameter",
            "PredictiveCheck",
            "RecordedSqueeze",
            "SqueezeFit",
            "Undetermined",
        ),
        ".inference": ("half_width", "interval_of_mean", "predictive_p"),
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
        "free_motion": ("NOT_FREE", "FreeLimits", "FreeMotion"),
    },
    "Contact and rest, the same for controllers and features": {
        "contact": (
            "CONTACT_FORCE_N",
            "REST_SPEED_M_S",
            "REST_WINDOW_S",
            "RestState",
            "at_rest",
            "both_touch",
            "first_rest",
            "update_rest",
        ),
    },
    "Feature sets": {
        "features": ("Features", "missing"),
        "roles": ("FeatureSet",),
        "compiled_features": (
            "CompiledExtraction",
            "CompiledFeatures",
            "TickColumns",
            "columns_of_ticks",
            "compiled_extraction",
        ),
        "trace": ("ImageTrace", "SampleTrace", "Trace", "TraceRecorder", "trace_of"),
        "units": ("in_words",),
    },
    "Classifiers": {
        "decision_path": ("SplitTest", "leaf_reason", "path_reasons"),
        "features": ("UNKNOWN", "FeatureTable", "Prediction", "table_of"),
        "reasons": ("Contribution", "FeatureValue", "Reason", "contribution_reasons", "missing_feature"),
        "roles": ("Classifier", "ClassifierConfig"),
        "stored_values": ("LARGEST_SEED", "StoredValueError", "StoredValues"),
        "tree": ("TreeNode",),
    },
    "Data sets": {
        "labelled": ("ControlFeatures", "Labelled"),
        "recording.labelled_recording": ("LabelledRecording", "UnreadableRecording"),
        "recording.readable": ("each_readable",),
        "recording.replayable": ("Recording",),
        "sources.grasp_columns": ("GraspColumns", "checked_recording"),
    },
    "Tests of a plugin": {
        "testing.conformance": ("parametrize_checks",),
        "testing.samples": ("a_trial", "squeeze", "sample_table", "with_channels"),
        "testing.model_gripper": ("model_gripper", "drive"),
    },
    "Observers": {
        "trial": ("GraspEvent", "RunInfo", "Trial", "event_name"),
    },
    "The tick of the runner, for a backend that runs it compiled": {
        "binding": ("bind", "maker"),
        "guard": ("GuardParams", "GuardState"),
        "run_config": ("RunConfig",),
        "runner": ("ended_by_itself", "overdue", "seconds_at_most", "tick_params"),
        "tick": (
            *("Schedule", "TickParams", "TickState", "events_of", "first_state", "tick"),
            *(
                "CALLED",
                "CLOSES",
                "FreeRun",
                "FreeState",
                "FreeTicks",
                "after_free",
                "free_from",
                "free_parts",
                "free_tick",
            ),
        ),
    },
    "Compiling a function with all that it calls": {
        "call_graph": ("NotCompilable", "fingerprint"),
        "compiling": (
            "CompileOptions",
            "Inlining",
            "compile_function",
            "entry_point",
            "first_call",
            "is_on_disk",
        ),
    },
    "Building other components, collecting what other plugins bring, and where to keep files": {
        "config": ("create", "recipe_of"),
        "plugins": ("collect",),
        "user_folders": ("cache_folder",),
        "whole_file": ("write_whole",),
        "closed_paths": ("is_closed", "make_closed"),
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

PUBLIC: Final = LazyNames("graspsense.plugin_api", _TABLE)

__all__ = PUBLIC.names


def __getattr__(name: str) -> Any:
    return PUBLIC.load(name)


def __dir__() -> list[str]:
    return __all__
