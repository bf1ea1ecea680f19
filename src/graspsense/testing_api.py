"""What the tests of a plugin use."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Conformance": {
        "testing.conformance": ("parametrize_checks",),
    },
    "Samples": {
        "testing.samples": ("a_trial", "squeeze", "sample_table", "with_channels"),
        "core.values.trace": ("ImageTrace", "SampleTrace", "TraceRecorder", "trace_of"),
    },
    "A gripper for tests": {
        "testing.model_gripper": ("model_gripper", "drive"),
    },
}

PUBLIC: Final = LazyNames("graspsense.testing_api", _TABLE)

__all__ = PUBLIC.names
