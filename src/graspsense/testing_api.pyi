"""The names of graspsense.testing_api, for type checkers and for `core/components/lazy_names.py`."""

# Conformance
from graspsense.testing.conformance import parametrize_checks as parametrize_checks

# Samples
from graspsense.testing.samples import a_trial as a_trial
from graspsense.testing.samples import squeeze as squeeze
from graspsense.testing.samples import sample_table as sample_table
from graspsense.testing.samples import with_channels as with_channels
from graspsense.core.values.trace import ImageTrace as ImageTrace
from graspsense.core.values.trace import SampleTrace as SampleTrace
from graspsense.core.values.trace import TraceRecorder as TraceRecorder
from graspsense.core.values.trace import trace_of as trace_of

# A gripper for tests
from graspsense.testing.model_gripper import model_gripper as model_gripper
from graspsense.testing.model_gripper import drive as drive
