"""What a plugin with kinds of experiments may import, besides `graspsense.plugin_api`.

A kind computes its tasks from a source of trials, and reports a `Summary` of their results as `Findings`.
"""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Declaring kinds of experiments": {
        "core.components.entries": ("ExperimentKindEntry", "ExperimentEntry"),
        "experiments.experiment": ("ExperimentCase",),
        "core.components.setting": ("ORIGINS", "fitted_defaults"),
        "core.components.config": ("settings_from",),
        "core.components.strict": ("structured",),
    },
    "Trials and recognition": {
        "core.learn.labelled": ("ControlFeatures", "Labelled"),
        "sources.trial_source": ("TrialSource", "SIMULATED", "groups_of"),
        "sources.simulated": ("plan_trials", "simulated_objects"),
        "experiments.recognise": ("EvaluationSettings", "recognise"),
        "experiments.task_results": ("MOST_KEPT_GRASPS", "RecognitionResult"),
    },
    "Results and their statistics": {
        "experiments.summary": ("ConditionResult", "Summary"),
        "evaluation.confusion": ("Confusion",),
        "evaluation.over_seeds": ("MeanDifference", "OverSeeds", "mean_difference"),
        "evaluation.intervals": ("wilson",),
    },
    "Findings: tables and words": {
        "experiments.findings": (
            "CONTROLS",
            "Findings",
            "FoundTable",
            "code",
            "control_cells",
            "percent",
            "span",
        ),
        "core.values.errors": ("counted",),
    },
    "Pictures and sections of a report": {
        "report.grasp_curve": ("GraspCurve", "grasp_curve"),
        "report.html": ("Section", "bullets", "figure", "pair", "panels", "paragraph"),
        "report.matrix": ("confusion_table",),
        "report.svg": ("INKS", "Picture", "reaching"),
        "report.traces": ("one_grasp",),
        "report.tree": ("tree_list",),
    },
}

PUBLIC: Final = LazyNames("graspsense.experiment_api", _TABLE)

__all__ = PUBLIC.names
