"""The names of graspsense.experiment_api, for type checkers and for `core/components/lazy_names.py`."""

# Declaring kinds of experiments
from graspsense.core.components.entries import ExperimentKindEntry as ExperimentKindEntry
from graspsense.core.components.entries import ExperimentEntry as ExperimentEntry
from graspsense.experiments.experiment import ExperimentCase as ExperimentCase
from graspsense.core.components.setting import fitted_defaults as fitted_defaults
from graspsense.core.settings.resolved import settings_from as settings_from
from graspsense.core.components.strict import structured as structured

# Trials and recognition
from graspsense.core.learn.labelled import ControlFeatures as ControlFeatures
from graspsense.core.learn.labelled import Labelled as Labelled
from graspsense.sources.trial_source import TrialSource as TrialSource
from graspsense.sources.trial_source import SIMULATED as SIMULATED
from graspsense.sources.trial_source import groups_of as groups_of
from graspsense.sources.simulated import plan_trials as plan_trials
from graspsense.sources.simulated import simulated_objects as simulated_objects
from graspsense.experiments.recognise import EvaluationSettings as EvaluationSettings
from graspsense.experiments.recognise import recognise as recognise
from graspsense.experiments.task_results import MOST_KEPT_GRASPS as MOST_KEPT_GRASPS
from graspsense.experiments.task_results import RecognitionResult as RecognitionResult

# Results and their statistics
from graspsense.experiments.summary import ConditionResult as ConditionResult
from graspsense.experiments.summary import Summary as Summary
from graspsense.evaluation.results import Confusion as Confusion
from graspsense.evaluation.over_seeds import MeanDifference as MeanDifference
from graspsense.evaluation.over_seeds import OverSeeds as OverSeeds
from graspsense.evaluation.over_seeds import mean_difference as mean_difference
from graspsense.evaluation.intervals import wilson as wilson

# Findings: tables and words
from graspsense.experiments.findings import CONTROLS as CONTROLS
from graspsense.experiments.findings import Findings as Findings
from graspsense.report.found_table import FoundTable as FoundTable
from graspsense.report.html import code as code
from graspsense.experiments.findings import control_cells as control_cells
from graspsense.evaluation.intervals import percent as percent
from graspsense.evaluation.intervals import span as span
from graspsense.core.values.errors import counted as counted

# Pictures and sections of a report
from graspsense.report.grasp_curve import GraspCurve as GraspCurve
from graspsense.report.grasp_curve import grasp_curve as grasp_curve
from graspsense.report.html import Section as Section
from graspsense.report.html import bullets as bullets
from graspsense.report.html import figure as figure
from graspsense.report.html import pair as pair
from graspsense.report.html import panels as panels
from graspsense.report.html import paragraph as paragraph
from graspsense.report.confusion import confusion_table as confusion_table
from graspsense.report.svg import INKS as INKS
from graspsense.report.svg import Picture as Picture
from graspsense.report.svg import reaching as reaching
from graspsense.report.traces import one_grasp as one_grasp
from graspsense.report.evaluation_sections import tree_list as tree_list
