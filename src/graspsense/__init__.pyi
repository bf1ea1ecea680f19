"""Generated from the table of graspsense by `graspsense.core.lazy_names`: change the table."""

__version__: str

# Running a grasp
from graspsense.core.pipeline import load_pipeline as load_pipeline
from graspsense.core.trial import Trial as Trial

# What a grasp returns
from graspsense.core.signals import Outcome as Outcome
from graspsense.core.signals import Phase as Phase
from graspsense.core.trace import Trace as Trace
from graspsense.core.features import FeatureTable as FeatureTable
from graspsense.core.features import Features as Features
from graspsense.core.features import Prediction as Prediction

# Errors
from graspsense.core.errors import GraspsenseError as GraspsenseError
