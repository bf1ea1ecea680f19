"""Generated from the table of graspsense by `graspsense.core.lazy_names`: change the table."""

__version__: str

# Running a grasp
from graspsense.core.pipeline import GraspInterrupted as GraspInterrupted
from graspsense.core.pipeline import load_pipeline as load_pipeline
from graspsense.core.trial import Trial as Trial

# What a grasp returns
from graspsense.core.signals import Outcome as Outcome
from graspsense.core.signals import Phase as Phase
from graspsense.core.trace import Trace as Trace
from graspsense.core.features import FeatureTable as FeatureTable
from graspsense.core.features import Features as Features
from graspsense.core.features import Prediction as Prediction

# Trials and evaluation
from graspsense.sources.trial_source import load_trials as load_trials
from graspsense.core.config import select_component as select_component
from graspsense.core.labelled import Labelled as Labelled
from graspsense.evaluation.evaluate import evaluate as evaluate
from graspsense.evaluation.results import Evaluation as Evaluation

# Experiments
from graspsense.experiments.experiment import read_experiment as read_experiment
from graspsense.experiments.executors.serial import Serial as Serial
from graspsense.experiments.results import Results as Results
from graspsense.experiments.run import run_experiment as run_experiment
from graspsense.experiments.summary import summarise as summarise

# Errors
from graspsense.core.errors import ConfigError as ConfigError
from graspsense.core.errors import GraspsenseError as GraspsenseError
from graspsense.core.errors import WiringError as WiringError
