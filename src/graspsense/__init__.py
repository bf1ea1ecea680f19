"""graspsense: recognise an object and its state from the forces while a gripper closes on it.

These are the names for users. A name is imported when it is first used; importing graspsense loads no plugin.
"""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames
from graspsense.core.values.display import drawn_by

__version__: Final = "0.1.0"

drawn_by("graspsense.report.notebook")

PUBLIC: Final = LazyNames(
    __name__,
    {
        "Running a grasp": {
            "core.pipeline.pipeline": ("GraspInterrupted", "load_pipeline"),
            "core.values.trial": ("Trial",),
        },
        "What a grasp returns": {
            "core.values.signals": ("Outcome", "Phase"),
            "core.values.trace": ("Trace",),
            "core.values.features": ("FeatureTable", "Features", "Prediction"),
        },
        "Trials and evaluation": {
            "sources.trial_source": ("load_trials",),
            "core.components.config": ("select_component",),
            "core.learn.labelled": ("Labelled",),
            "evaluation.evaluate": ("evaluate",),
            "evaluation.results": ("Evaluation",),
        },
        "Experiments": {
            "experiments.experiment": ("read_experiment",),
            "experiments.executors.serial": ("Serial",),
            "experiments.results": ("Results",),
            "experiments.run": ("run_experiment",),
            "experiments.summary": ("summarise",),
        },
        "Errors": {"core.values.errors": ("ConfigError", "GraspsenseError", "WiringError")},
    },
)

__all__ = ["__version__", *PUBLIC.names]
