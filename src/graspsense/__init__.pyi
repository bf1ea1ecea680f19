"""The names of graspsense, for type checkers and for `core/components/lazy_names.py`."""

__version__: str

# Running a grasp
from graspsense.core.pipeline.pipeline import GraspInterrupted as GraspInterrupted
from graspsense.core.pipeline.pipeline import load_pipeline as load_pipeline
from graspsense.core.values.trial import Trial as Trial

# What a grasp returns
from graspsense.core.values.signals import Outcome as Outcome
from graspsense.core.values.signals import Phase as Phase
from graspsense.core.values.trace import Trace as Trace
from graspsense.core.values.features import FeatureTable as FeatureTable
from graspsense.core.values.features import Features as Features
from graspsense.core.values.features import Prediction as Prediction

# Trials and evaluation
from graspsense.sources.trial_source import load_trials as load_trials
from graspsense.core.settings.selected import select_component as select_component
from graspsense.core.learn.labelled import Labelled as Labelled
from graspsense.evaluation.evaluate import evaluate as evaluate
from graspsense.evaluation.results import Evaluation as Evaluation

# Experiments
from graspsense.experiments.experiment_file import read_experiment as read_experiment
from graspsense.experiments.executors.executor import Serial as Serial
from graspsense.experiments.results import Results as Results
from graspsense.experiments.run import run_experiment as run_experiment
from graspsense.experiments.summary import summarise as summarise

# Errors
from graspsense.core.values.errors import ConfigError as ConfigError
from graspsense.core.values.errors import GraspsenseError as GraspsenseError
from graspsense.core.values.errors import WiringError as WiringError
