"""Generated from the table of graspsense.plugin_api by `graspsense.core.lazy_names`: change the table."""

# Declaring what a plugin brings
from graspsense.core.hookspecs import hookimpl as hookimpl
from graspsense.core.entries import Channel as Channel
from graspsense.core.entries import ClassifierEntry as ClassifierEntry
from graspsense.core.entries import CommandEntry as CommandEntry
from graspsense.core.entries import ConformanceCheckEntry as ConformanceCheckEntry
from graspsense.core.entries import ControllerEntry as ControllerEntry
from graspsense.core.entries import DatasetEntry as DatasetEntry
from graspsense.core.entries import EmulatorEntry as EmulatorEntry
from graspsense.core.entries import FastChannel as FastChannel
from graspsense.core.entries import Feature as Feature
from graspsense.core.entries import FeatureSetEntry as FeatureSetEntry
from graspsense.core.entries import Finding as Finding
from graspsense.core.entries import FoundDevice as FoundDevice
from graspsense.core.entries import ModelEntry as ModelEntry
from graspsense.core.entries import PipelineEntry as PipelineEntry
from graspsense.core.entries import SensorBackendEntry as SensorBackendEntry
from graspsense.core.entries import TactileArray as TactileArray
from graspsense.core.setting import CHANGES_NO_RESULT as CHANGES_NO_RESULT
from graspsense.core.setting import NAMES_INPUT as NAMES_INPUT
from graspsense.core.setting import setting as setting
from graspsense.core.toml_text import TomlError as TomlError
from graspsense.core.toml_text import toml_values as toml_values
from graspsense.core.figure_origins import fitted_results as fitted_results
from graspsense.core.figure_origins import given_claims as given_claims
from graspsense.core.figure_origins import gives as gives

# Signals: what passes between a gripper and a controller
from graspsense.core.signals import CHANNELS as CHANNELS
from graspsense.core.signals import NO_PADS as NO_PADS
from graspsense.core.signals import Command as Command
from graspsense.core.signals import CommandKind as CommandKind
from graspsense.core.signals import Frame as Frame
from graspsense.core.signals import Image as Image
from graspsense.core.signals import Outcome as Outcome
from graspsense.core.signals import Pads as Pads
from graspsense.core.signals import Phase as Phase
from graspsense.core.signals import Reading as Reading
from graspsense.core.signals import Samples as Samples
from graspsense.core.signals import no_pads as no_pads

# The same kinds, phases and outcomes as plain integers, for laws that are compiled
from graspsense.core.signals import APPROACH as APPROACH
from graspsense.core.signals import CRUSHED as CRUSHED
from graspsense.core.signals import EFFORT as EFFORT
from graspsense.core.signals import FORCE as FORCE
from graspsense.core.signals import HOLD as HOLD
from graspsense.core.signals import NEVER_STEADY as NEVER_STEADY
from graspsense.core.signals import NOTHING_THERE as NOTHING_THERE
from graspsense.core.signals import ONE_FINGER as ONE_FINGER
from graspsense.core.signals import POSITION as POSITION
from graspsense.core.signals import RUNNING as RUNNING
from graspsense.core.signals import SIDE_IMPACT as SIDE_IMPACT
from graspsense.core.signals import SLIPPED as SLIPPED
from graspsense.core.signals import SQUEEZE as SQUEEZE
from graspsense.core.signals import STEADY as STEADY
from graspsense.core.signals import TOO_WIDE as TOO_WIDE
from graspsense.core.signals import VELOCITY as VELOCITY
from graspsense.core.tick import OPENING as OPENING
from graspsense.core.tick import RELEASE as RELEASE
from graspsense.core.tick import TARING as TARING

# Sensor backends
from graspsense.core.faults import StatusBit as StatusBit
from graspsense.core.roles import DeviceInfo as DeviceInfo
from graspsense.core.roles import ObjectKind as ObjectKind
from graspsense.core.roles import SensorBackend as SensorBackend
from graspsense.core.channels import no_signals as no_signals
from graspsense.core.channels import signal_type as signal_type

# Sensor backends that do many grasps at once
from graspsense.core.roles import BatchBackend as BatchBackend
from graspsense.core.roles import BatchOptions as BatchOptions
from graspsense.core.roles import Grasped as Grasped
from graspsense.core.roles import SimulationVariant as SimulationVariant

# Sensor backends that identify an object from recorded squeezes
from graspsense.core.identification import CandidateScore as CandidateScore
from graspsense.core.identification import Identification as Identification
from graspsense.core.identification import IdentifiedParameter as IdentifiedParameter
from graspsense.core.identification import PredictiveCheck as PredictiveCheck
from graspsense.core.identification import RecordedSqueeze as RecordedSqueeze
from graspsense.core.identification import SqueezeFit as SqueezeFit
from graspsense.core.identification import Undetermined as Undetermined
from graspsense.inference import half_width as half_width
from graspsense.inference import interval_of_mean as interval_of_mean
from graspsense.inference import predictive_p as predictive_p

# Emulated devices
from graspsense.core.emulated import EmulatedDevice as EmulatedDevice

# Calibration: from cell counts to newtons
from graspsense.core.calibration import LoadTable as LoadTable
from graspsense.core.calibration import edge_force as edge_force
from graspsense.core.calibration import load_of as load_of
from graspsense.core.calibration import masked as masked
from graspsense.core.calibration import pad_force as pad_force
from graspsense.core.calibration import tare as tare
from graspsense.core.calibration import zero_of as zero_of
from graspsense.core.calibration_files import calibrations_of as calibrations_of
from graspsense.core.calibration_files import stored_friction as stored_friction
from graspsense.core.calibration_files import stored_tables as stored_tables
from graspsense.core.calibration_files import stored_zero as stored_zero

# Transmission: from motor revolutions to the gap
from graspsense.core.transmission import ScrewLinkage as ScrewLinkage
from graspsense.core.transmission import gap_and_rate as gap_and_rate
from graspsense.core.transmission import revolutions_at as revolutions_at
from graspsense.core.transmission import screw_linkage as screw_linkage
from graspsense.core.transmission import straight_linkage as straight_linkage

# Controllers
from graspsense.core.roles import Controller as Controller
from graspsense.core.roles import ControllerState as ControllerState
from graspsense.core.roles import StepLaw as StepLaw
from graspsense.core.free_motion import NOT_FREE as NOT_FREE
from graspsense.core.free_motion import FreeLimits as FreeLimits
from graspsense.core.free_motion import FreeMotion as FreeMotion

# Contact and rest, the same for controllers and features
from graspsense.core.contact import CONTACT_FORCE_N as CONTACT_FORCE_N
from graspsense.core.contact import REST_SPEED_M_S as REST_SPEED_M_S
from graspsense.core.contact import REST_WINDOW_S as REST_WINDOW_S
from graspsense.core.contact import RestState as RestState
from graspsense.core.contact import at_rest as at_rest
from graspsense.core.contact import both_touch as both_touch
from graspsense.core.contact import first_rest as first_rest
from graspsense.core.contact import update_rest as update_rest

# Feature sets
from graspsense.core.features import Features as Features
from graspsense.core.features import missing as missing
from graspsense.core.roles import FeatureSet as FeatureSet
from graspsense.core.compiled_features import CompiledExtraction as CompiledExtraction
from graspsense.core.compiled_features import CompiledFeatures as CompiledFeatures
from graspsense.core.compiled_features import TickColumns as TickColumns
from graspsense.core.compiled_features import columns_of_ticks as columns_of_ticks
from graspsense.core.compiled_features import compiled_extraction as compiled_extraction
from graspsense.core.trace import ImageTrace as ImageTrace
from graspsense.core.trace import SampleTrace as SampleTrace
from graspsense.core.trace import Trace as Trace
from graspsense.core.trace import TraceRecorder as TraceRecorder
from graspsense.core.trace import trace_of as trace_of
from graspsense.core.units import in_words as in_words

# Classifiers
from graspsense.core.decision_path import SplitTest as SplitTest
from graspsense.core.decision_path import leaf_reason as leaf_reason
from graspsense.core.decision_path import path_reasons as path_reasons
from graspsense.core.features import UNKNOWN as UNKNOWN
from graspsense.core.features import FeatureTable as FeatureTable
from graspsense.core.features import Prediction as Prediction
from graspsense.core.features import table_of as table_of
from graspsense.core.reasons import Contribution as Contribution
from graspsense.core.reasons import FeatureValue as FeatureValue
from graspsense.core.reasons import Reason as Reason
from graspsense.core.reasons import contribution_reasons as contribution_reasons
from graspsense.core.reasons import missing_feature as missing_feature
from graspsense.core.roles import Classifier as Classifier
from graspsense.core.roles import ClassifierConfig as ClassifierConfig
from graspsense.core.stored_values import LARGEST_SEED as LARGEST_SEED
from graspsense.core.stored_values import StoredValueError as StoredValueError
from graspsense.core.stored_values import StoredValues as StoredValues
from graspsense.core.tree import TreeNode as TreeNode

# Data sets
from graspsense.core.labelled import ControlFeatures as ControlFeatures
from graspsense.core.labelled import Labelled as Labelled
from graspsense.recording.labelled_recording import LabelledRecording as LabelledRecording
from graspsense.recording.labelled_recording import UnreadableRecording as UnreadableRecording
from graspsense.recording.readable import each_readable as each_readable
from graspsense.recording.replayable import Recording as Recording
from graspsense.sources.grasp_columns import GraspColumns as GraspColumns
from graspsense.sources.grasp_columns import checked_recording as checked_recording

# Tests of a plugin
from graspsense.testing.conformance import parametrize_checks as parametrize_checks
from graspsense.testing.samples import a_trial as a_trial
from graspsense.testing.samples import squeeze as squeeze
from graspsense.testing.samples import sample_table as sample_table
from graspsense.testing.samples import with_channels as with_channels
from graspsense.testing.model_gripper import model_gripper as model_gripper
from graspsense.testing.model_gripper import drive as drive

# Observers
from graspsense.core.trial import GraspEvent as GraspEvent
from graspsense.core.trial import RunInfo as RunInfo
from graspsense.core.trial import Trial as Trial
from graspsense.core.trial import event_name as event_name

# The tick of the runner, for a backend that runs it compiled
from graspsense.core.binding import bind as bind
from graspsense.core.binding import maker as maker
from graspsense.core.guard import GuardParams as GuardParams
from graspsense.core.guard import GuardState as GuardState
from graspsense.core.run_config import RunConfig as RunConfig
from graspsense.core.runner import ended_by_itself as ended_by_itself
from graspsense.core.runner import overdue as overdue
from graspsense.core.runner import seconds_at_most as seconds_at_most
from graspsense.core.runner import tick_params as tick_params
from graspsense.core.tick import Schedule as Schedule
from graspsense.core.tick import TickParams as TickParams
from graspsense.core.tick import TickState as TickState
from graspsense.core.tick import events_of as events_of
from graspsense.core.tick import first_state as first_state
from graspsense.core.tick import tick as tick
from graspsense.core.tick import CALLED as CALLED
from graspsense.core.tick import CLOSES as CLOSES
from graspsense.core.tick import FreeRun as FreeRun
from graspsense.core.tick import FreeState as FreeState
from graspsense.core.tick import FreeTicks as FreeTicks
from graspsense.core.tick import after_free as after_free
from graspsense.core.tick import free_from as free_from
from graspsense.core.tick import free_parts as free_parts
from graspsense.core.tick import free_tick as free_tick

# Compiling a function with all that it calls
from graspsense.core.call_graph import NotCompilable as NotCompilable
from graspsense.core.call_graph import fingerprint as fingerprint
from graspsense.core.compiling import CompileOptions as CompileOptions
from graspsense.core.compiling import Inlining as Inlining
from graspsense.core.compiling import compile_function as compile_function
from graspsense.core.compiling import entry_point as entry_point
from graspsense.core.compiling import first_call as first_call
from graspsense.core.compiling import is_on_disk as is_on_disk

# Building other components, collecting what other plugins bring, and where to keep files
from graspsense.core.config import create as create
from graspsense.core.config import recipe_of as recipe_of
from graspsense.core.plugins import collect as collect
from graspsense.core.user_folders import cache_folder as cache_folder
from graspsense.core.whole_file import write_whole as write_whole
from graspsense.core.closed_paths import is_closed as is_closed
from graspsense.core.closed_paths import make_closed as make_closed

# Errors
from graspsense.core.errors import ConfigError as ConfigError
from graspsense.core.errors import DataDamaged as DataDamaged
from graspsense.core.errors import DeviceLost as DeviceLost
from graspsense.core.errors import GraspsenseError as GraspsenseError
from graspsense.core.errors import NoDevice as NoDevice
from graspsense.core.errors import PluginUnavailable as PluginUnavailable
from graspsense.core.errors import RecordingEnded as RecordingEnded
from graspsense.core.errors import TareRefused as TareRefused
from graspsense.core.errors import UnknownName as UnknownName
from graspsense.core.errors import suggestion as suggestion
