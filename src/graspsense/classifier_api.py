"""What classifiers need to explain an answer and to read nominal features, besides `graspsense.plugin_api`."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Reasons for an answer": {
        "core.values.reasons": (
            "Reason",
            "FeatureValue",
            "Contribution",
            "contribution_reasons",
            "missing_feature",
        ),
        "core.values.units": ("in_words",),
    },
    "Trees": {
        "core.values.tree": ("TreeNode",),
        "core.learn.decision_path": ("SplitTest", "leaf_reason", "path_reasons"),
    },
    "Tables and nominal features": {
        "core.values.features": ("table_of",),
        "core.values.nominal": ("CodedColumn", "codes_of", "with_codes"),
    },
    "Linear algebra": {
        "core.learn.one_thread": ("one_thread",),
    },
    "Stored models": {
        "core.learn.stored_values": ("LARGEST_SEED",),
    },
}

PUBLIC: Final = LazyNames("graspsense.classifier_api", _TABLE)

__all__ = PUBLIC.names
