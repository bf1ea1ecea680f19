"""What a plugin with kinds of experiments may import, besides `graspsense.plugin_api`.

A kind computes its tasks from a source of trials, and reports a `Summary` of their results as `Findings`. Import it in
the modules that the entries of the plugin name, not in the plugin module itself, which must stay light.
"""

from __future__ import annotations

from graspsense.core.components.config import settings_from
from graspsense.core.components.figure_origins import ORIGINS
from graspsense.core.components.setting import fitted_defaults
from graspsense.core.components.strict import structured
from graspsense.evaluation.confusion import Confusion
from graspsense.evaluation.intervals import wilson
from graspsense.evaluation.over_seeds import MeanDifference, OverSeeds, mean_difference
from graspsense.experiments.experiment import ExperimentCase
from graspsense.experiments.findings import (
    CONTROLS,
    Findings,
    FoundTable,
    code,
    control_cells,
    percent,
    span,
)
from graspsense.experiments.recognise import EvaluationSettings, recognise
from graspsense.experiments.summary import ConditionResult, Summary
from graspsense.experiments.task_results import MOST_KEPT_GRASPS, RecognitionResult
from graspsense.report.grasp_curve import GraspCurve, grasp_curve
from graspsense.report.html import Section, bullets, figure, pair, panels, paragraph
from graspsense.report.matrix import confusion_table
from graspsense.report.svg import INKS, Picture, reaching
from graspsense.report.traces import one_grasp
from graspsense.report.tree import tree_list
from graspsense.sources.simulated import plan_trials, simulated_objects
from graspsense.sources.trial_source import SIMULATED, TrialSource, groups_of

__all__ = [
    "CONTROLS",
    "INKS",
    "MOST_KEPT_GRASPS",
    "ORIGINS",
    "SIMULATED",
    "ConditionResult",
    "Confusion",
    "EvaluationSettings",
    "ExperimentCase",
    "Findings",
    "FoundTable",
    "GraspCurve",
    "MeanDifference",
    "OverSeeds",
    "Picture",
    "RecognitionResult",
    "Section",
    "Summary",
    "TrialSource",
    "bullets",
    "code",
    "confusion_table",
    "control_cells",
    "figure",
    "fitted_defaults",
    "grasp_curve",
    "groups_of",
    "mean_difference",
    "one_grasp",
    "pair",
    "panels",
    "paragraph",
    "percent",
    "plan_trials",
    "reaching",
    "recognise",
    "settings_from",
    "simulated_objects",
    "span",
    "structured",
    "tree_list",
    "wilson",
]
