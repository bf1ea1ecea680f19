"""What only simulators and compiled code need, besides `graspsense.plugin_api`."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Many grasps at once": {
        "core.components.roles": ("BatchBackend", "BatchOptions", "Grasped", "SimulationVariant", "Viewer"),
        "core.grasp.runner": ("run_uninterrupted",),
        "core.components.run_config": ("RunConfig",),
    },
    "Models, and settings in files of their own": {
        "core.components.entries": ("ModelEntry",),
        "core.components.setting": ("CHANGES_NO_RESULT",),
        "core.components.strict": ("ValidationFailed", "structured"),
        "core.components.toml_kinds": ("refuse_other_kind",),
        "core.files.toml_text": ("TomlError", "toml_values"),
        "core.values.errors": ("suggestion",),
        "core.components.config": ("recipe_of",),
        "core.values.signals": ("CHANNELS",),
    },
    "Hooks of a plugin's own, and checks of what they return": {
        "core.components.entries": ("ConformanceCheckEntry",),
        "core.components.registry": ("collect",),
    },
    "Where figures come from": {
        "core.components.setting": ("fitted_results", "given_claims", "gives"),
    },
    "Identifying an object from recorded squeezes": {
        "core.components.entries": ("IdentifierEntry",),
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
        "core.grasp.transmission": ("straight_linkage",),
    },
    "Laws and features that are compiled": {
        "core.control.free_motion": ("NOT_FREE", "FreeLimits", "FreeMotion"),
        "core.components.compiled_features": (
            "CompiledExtraction",
            "CompiledFeatures",
            "TickColumns",
            "compiled_extraction",
        ),
    },
    "The tick of the runner, for a backend that runs it compiled": {
        "core.control.binding": ("bind", "maker"),
        "core.control.tick": (
            "TickParams",
            "TickState",
            "TARING",
            "tick",
            "first_state",
            "events_of",
            "CALLED",
            "CLOSES",
            "FreeRun",
            "after_free",
            "free_from",
            "free_parts",
            "free_tick",
        ),
        "core.grasp.runner": ("tick_params", "ended_by_itself", "overdue", "seconds_at_most"),
        "core.values.events": ("event_name",),
        "core.values.trace": ("FrameTable",),
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
    "Where to keep files, and reading those that a user names": {
        "core.files.user_folders": ("cache_folder",),
        "core.files.whole_file": ("write_whole",),
        "core.files.regular_file": ("first_bytes",),
        "core.files.closed_paths": ("is_closed", "make_closed"),
    },
}

PUBLIC: Final = LazyNames("graspsense.simulator_api", _TABLE)

__all__ = PUBLIC.names
