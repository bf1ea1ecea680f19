"""The names of graspsense.simulator_api, for type checkers and for `core/components/lazy_names.py`."""

# Many grasps at once
from graspsense.core.components.roles import BatchBackend as BatchBackend
from graspsense.core.components.roles import BatchOptions as BatchOptions
from graspsense.core.components.roles import Grasped as Grasped
from graspsense.core.components.roles import SimulationVariant as SimulationVariant
from graspsense.core.components.roles import Viewer as Viewer
from graspsense.core.grasp.runner import run_uninterrupted as run_uninterrupted
from graspsense.core.drivers.grasp_process import GraspProcess as GraspProcess
from graspsense.core.drivers.grasp_process import HandedGrasp as HandedGrasp
from graspsense.core.drivers.grasp_process import NotHandedOver as NotHandedOver
from graspsense.core.components.run_config import RunConfig as RunConfig

# Models, and settings in files of their own
from graspsense.core.components.entries import ModelEntry as ModelEntry
from graspsense.core.components.setting import CHANGES_NO_RESULT as CHANGES_NO_RESULT
from graspsense.core.components.strict import ValidationFailed as ValidationFailed
from graspsense.core.components.strict import structured as structured
from graspsense.core.settings.layers import read_toml as read_toml
from graspsense.core.files.toml_text import settings_text as settings_text
from graspsense.core.settings.layers import toml_layer as toml_layer
from graspsense.core.files.toml_text import toml_values as toml_values
from graspsense.core.values.errors import suggestion as suggestion
from graspsense.core.settings.selected import recipe_of as recipe_of
from graspsense.core.values.signals import CHANNELS as CHANNELS

# Hooks of a plugin's own, and checks of what they return
from graspsense.core.components.entries import ConformanceCheckEntry as ConformanceCheckEntry
from graspsense.core.components.registry import collect as collect

# Where figures come from
from graspsense.core.components.setting import fitted_results as fitted_results
from graspsense.core.components.setting import given_claims as given_claims
from graspsense.core.components.setting import gives as gives
from graspsense.core.values.units import STANDARD_GRAVITY_M_S2 as STANDARD_GRAVITY_M_S2

# Identifying an object from recorded squeezes
from graspsense.core.components.entries import IdentifierEntry as IdentifierEntry
from graspsense.core.components.identification import CandidateScore as CandidateScore
from graspsense.core.components.identification import Identification as Identification
from graspsense.core.components.identification import IdentifiedParameter as IdentifiedParameter
from graspsense.core.components.identification import PredictiveCheck as PredictiveCheck
from graspsense.core.components.identification import RecordedSqueeze as RecordedSqueeze
from graspsense.core.components.identification import SqueezeFit as SqueezeFit
from graspsense.core.components.identification import Undetermined as Undetermined
from graspsense.core.components.identification import repeatability as repeatability
from graspsense.core.drivers.transmission import straight_linkage as straight_linkage

# Laws and features that are compiled
from graspsense.core.components.step_params import params_of as params_of
from graspsense.core.control.free_motion import NOT_FREE as NOT_FREE
from graspsense.core.control.free_motion import FreeLimits as FreeLimits
from graspsense.core.control.free_motion import FreeMotion as FreeMotion
from graspsense.core.components.compiled_features import CompiledExtraction as CompiledExtraction
from graspsense.core.components.compiled_features import CompiledFeatures as CompiledFeatures
from graspsense.core.components.compiled_features import TickColumns as TickColumns
from graspsense.core.components.compiled_features import listed_columns as listed_columns
from graspsense.core.components.compiled_features import compiled_extraction as compiled_extraction

# The tick of the runner, for a backend that runs it compiled
from graspsense.core.control.binding import bind as bind
from graspsense.core.control.binding import maker as maker
from graspsense.core.control.tick import TickParams as TickParams
from graspsense.core.control.tick import TickState as TickState
from graspsense.core.control.tick import TARING as TARING
from graspsense.core.control.tick import tick as tick
from graspsense.core.control.tick import first_state as first_state
from graspsense.core.control.tick import events_of as events_of
from graspsense.core.control.tick import CLOSES as CLOSES
from graspsense.core.control.tick import after_free as after_free
from graspsense.core.control.tick import free_from as free_from
from graspsense.core.control.tick import free_parts as free_parts
from graspsense.core.control.tick import free_tick as free_tick
from graspsense.core.grasp.runner import tick_params as tick_params
from graspsense.core.grasp.runner import ended_by_itself as ended_by_itself
from graspsense.core.grasp.opened_gripper import overdue as overdue
from graspsense.core.grasp.opened_gripper import seconds_at_most as seconds_at_most
from graspsense.core.values.signals import event_name as event_name

# Compiling a function with all that it calls
from graspsense.core.compiling.call_graph import NotCompilable as NotCompilable
from graspsense.core.compiling.call_graph import fingerprint as fingerprint
from graspsense.core.compiling.compiling import CompileOptions as CompileOptions
from graspsense.core.compiling.compiling import Inlining as Inlining
from graspsense.core.compiling.compiling import compile_function as compile_function
from graspsense.core.compiling.compiling import entry_point as entry_point
from graspsense.core.compiling.compiling import first_call as first_call
from graspsense.core.compiling.compiling import is_on_disk as is_on_disk

# Where to keep files, and reading those that a user names
from graspsense.core.files.user_folders import cache_folder as cache_folder
from graspsense.core.files.whole_file import write_whole as write_whole
from graspsense.core.files.whole_file import first_bytes as first_bytes
from graspsense.core.files.user_folders import is_closed as is_closed
from graspsense.core.files.user_folders import make_closed as make_closed
