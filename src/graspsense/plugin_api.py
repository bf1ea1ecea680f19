"""Everything that a plugin may import from graspsense, grouped by what it is for.

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
        "core.values.channel": ("Channel", "FastChannel", "TactileArray"),
        "core.values.fingers": ("FingerForce",),
        "core.components.entries": (
            "ClassifierEntry",
            "CommandEntry",
            "ConformanceCheckEntry",
            "ControllerEntry",
            "DatasetEntry",
            "EmulatorEntry",
            "ExperimentEntry",
            "ExperimentKindEntry",
            "Feature",
            "FeatureSetEntry",
            "Finding",
            "FoundDevice",
            "IdentifierEntry",
            "ModelEntry",
            "PipelineEntry",
            "SensorBackendEntry",
        ),
        "core.components.setting": ("CHANGES_NO_RESULT", "NAMES_INPUT", "setting"),
        "core.components.strict": ("ValidationFailed", "structured"),
        "core.components.toml_kinds": ("refuse_other_kind",),
        "core.files.toml_text": ("TomlError", "toml_values"),
        "core.components.figure_origins": ("fitted_results", "given_claims", "gives"),
    },
    "Signals: what passes between a gripper and a controller": {
        "core.values.signals": (
            "CHANNELS",
            "NO_GAP",
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
        "core.values.signals": (
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
        "core.control.tick": ("OPENING", "RELEASE", "TARING"),
    },
    "Sensor backends": {
        "core.values.faults": ("StatusBit",),
        "core.values.device": ("DeviceInfo",),
        "core.values.mounting": ("Mounting",),
        "core.components.roles": ("ObjectKind", "SensorBackend", "Viewer"),
        "core.components.channels": ("no_signals", "signal_type"),
        "core.values.fingers": ("opposed_forces",),
        "core.grasp.reading_thread": ("ReadingThread",),
        "core.grasp.device_clock": ("ClockLine", "DeviceClock"),
    },
    "Sensor backends that do many grasps at once": {
        "core.components.roles": ("BatchBackend", "BatchOptions", "Grasped", "SimulationVariant"),
        "core.grasp.runner": ("run_uninterrupted",),
    },
    "Identifying an object from recorded squeezes": {
        "core.components.identification": (
            "CandidateScore",
            "Identification",
            "IdentifiedParameter",
            "PredictiveCheck",
            "RecordedSqueeze",
            "SqueezeFit",
            "Undetermined",
            "repeatability",
        ),
    },
    "Emulated devices": {
        "core.components.emulated": ("EmulatedDevice",),
    },
    "Calibration: from cell counts to newtons": {
        "core.grasp.calibration": (
            "LoadTable",
            "edge_force",
            "load_of",
            "masked",
            "pad_force",
            "tare",
            "zero_of",
        ),
        "core.grasp.calibration_files": (
            "calibrations_of",
            "stored_friction",
            "stored_tables",
            "stored_zero",
        ),
    },
    "Transmission: from motor revolutions to the gap": {
        "core.grasp.transmission": (
            "ScrewLinkage",
            "gap_and_rate",
            "revolutions_at",
            "screw_linkage",
            "straight_linkage",
        ),
    },
    "Controllers": {
        "core.components.roles": ("Controller", "ControllerState", "StepLaw"),
        "core.control.free_motion": ("NOT_FREE", "FreeLimits", "FreeMotion"),
    },
    "Contact and rest, the same for controllers and features": {
        "core.control.contact": (
            "CONTACT_FORCE_N",
            "REST_SPEED_M_S",
            "REST_WINDOW_S",
            "RestState",
            "at_rest",
            "both_touch",
            "first_rest",
            "update_rest",
        ),
        "core.grasp.gap_resolution": (
            "GapResolution",
            "gap_resolution",
            "gap_resolution_by_sample",
            "window_of_rest",
        ),
    },
    "Feature sets": {
        "core.values.features": ("Features", "missing"),
        "core.components.roles": ("FeatureSet",),
        "core.components.compiled_features": (
            "CompiledExtraction",
            "CompiledFeatures",
            "TickColumns",
            "columns_of_ticks",
            "compiled_extraction",
        ),
        "core.values.trace": ("ImageTrace", "SampleTrace", "Trace", "TraceRecorder", "trace_of"),
        "core.values.units": ("in_words",),
    },
    "Classifiers": {
        "core.learn.decision_path": ("SplitTest", "leaf_reason", "path_reasons"),
        "core.values.features": ("UNKNOWN", "FeatureTable", "Prediction", "table_of"),
        "core.values.nominal": ("CodedColumn", "codes_of", "with_codes"),
        "core.values.reasons": (
            "Contribution",
            "FeatureValue",
            "Reason",
            "contribution_reasons",
            "missing_feature",
        ),
        "core.components.roles": ("Classifier", "ClassifierConfig"),
        "core.learn.stored_values": ("LARGEST_SEED", "StoredValueError", "StoredValues"),
        "core.values.tree": ("TreeNode",),
    },
    "Data sets": {
        "core.learn.labelled": ("ControlFeatures", "Labelled"),
        "recording.labelled_recording": ("LabelledRecording", "UnreadableRecording"),
        "recording.readable": ("each_readable",),
        "recording.replayable": ("Recording",),
        "sources.grasp_columns": ("GraspColumns", "checked_recording"),
        "sources.manifest.parquet_format": ("read_parquet",),
        "sources.manifest.steps": ("squeezes",),
        "sources.manifest.table": ("ColumnTable",),
        "store.stored_grasps": ("StoredGrasp",),
    },
    "Tests of a plugin": {
        "testing.conformance": ("parametrize_checks",),
        "testing.samples": ("a_trial", "squeeze", "sample_table", "with_channels"),
        "testing.model_gripper": ("model_gripper", "drive"),
    },
    "Observers": {
        "core.values.events": ("GraspEvent", "event_name"),
        "core.values.trial": ("RunInfo", "Trial"),
    },
    "The tick of the runner, for a backend that runs it compiled": {
        "core.control.binding": ("bind", "maker"),
        "core.control.guard": ("GuardParams", "GuardState"),
        "core.components.run_config": ("RunConfig",),
        "core.grasp.runner": ("ended_by_itself", "overdue", "seconds_at_most", "tick_params"),
        "core.control.tick": (
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
        "core.compiling.call_graph": ("NotCompilable", "fingerprint"),
        "core.compiling.compiling": (
            "CompileOptions",
            "Inlining",
            "compile_function",
            "entry_point",
            "first_call",
            "is_on_disk",
        ),
    },
    "Building other components, collecting what other plugins bring, and where to keep files": {
        "core.components.config": ("create", "recipe_of"),
        "core.components.registry": ("collect",),
        "core.files.user_folders": ("cache_folder",),
        "core.files.whole_file": ("write_whole",),
        "core.files.closed_paths": ("is_closed", "make_closed"),
    },
    "Errors": {
        "core.values.errors": (
            "ConfigError",
            "DataDamaged",
            "DeviceLost",
            "GraspsenseError",
            "NoDevice",
            "PluginUnavailable",
            "RecordingEnded",
            "TareRefused",
            "TooLarge",
            "UnknownName",
            "suggestion",
        ),
        "recording.atomic_file": ("SaveFailed",),
    },
}

PUBLIC: Final = LazyNames("graspsense.plugin_api", _TABLE)

__all__ = PUBLIC.names


def __getattr__(name: str) -> Any:
    return PUBLIC.load(name)


def __dir__() -> list[str]:
    return __all__
