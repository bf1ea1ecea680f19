"""Generated from the table of graspsense.plugin_api by `core/components/lazy_names.py`: change the table."""

# Declaring what a plugin brings
from graspsense.core.components.hookspecs import hookimpl as hookimpl
from graspsense.core.values.channel import Channel as Channel
from graspsense.core.values.channel import FastChannel as FastChannel
from graspsense.core.values.channel import TactileArray as TactileArray
from graspsense.core.values.fingers import FingerForce as FingerForce
from graspsense.core.components.entries import ClassifierEntry as ClassifierEntry
from graspsense.core.components.entries import CommandEntry as CommandEntry
from graspsense.core.components.entries import ConformanceCheckEntry as ConformanceCheckEntry
from graspsense.core.components.entries import ControllerEntry as ControllerEntry
from graspsense.core.components.entries import DatasetEntry as DatasetEntry
from graspsense.core.components.entries import EmulatorEntry as EmulatorEntry
from graspsense.core.components.entries import ExperimentEntry as ExperimentEntry
from graspsense.core.components.entries import ExperimentKindEntry as ExperimentKindEntry
from graspsense.core.components.entries import Feature as Feature
from graspsense.core.components.entries import FeatureSetEntry as FeatureSetEntry
from graspsense.core.components.entries import Finding as Finding
from graspsense.core.components.entries import FoundDevice as FoundDevice
from graspsense.core.components.entries import IdentifierEntry as IdentifierEntry
from graspsense.core.components.entries import ModelEntry as ModelEntry
from graspsense.core.components.entries import PipelineEntry as PipelineEntry
from graspsense.core.components.entries import SensorBackendEntry as SensorBackendEntry
from graspsense.core.components.setting import CHANGES_NO_RESULT as CHANGES_NO_RESULT
from graspsense.core.components.setting import NAMES_INPUT as NAMES_INPUT
from graspsense.core.components.setting import setting as setting
from graspsense.core.components.strict import ValidationFailed as ValidationFailed
from graspsense.core.components.strict import structured as structured
from graspsense.core.components.toml_kinds import refuse_other_kind as refuse_other_kind
from graspsense.core.files.toml_text import TomlError as TomlError
from graspsense.core.files.toml_text import toml_values as toml_values
from graspsense.core.components.figure_origins import fitted_results as fitted_results
from graspsense.core.components.figure_origins import given_claims as given_claims
from graspsense.core.components.figure_origins import gives as gives

# Signals: what passes between a gripper and a controller
from graspsense.core.values.signals import CHANNELS as CHANNELS
from graspsense.core.values.signals import NO_GAP as NO_GAP
from graspsense.core.values.signals import NO_PADS as NO_PADS
from graspsense.core.values.signals import Command as Command
from graspsense.core.values.signals import CommandKind as CommandKind
from graspsense.core.values.signals import Frame as Frame
from graspsense.core.values.signals import Image as Image
from graspsense.core.values.signals import Outcome as Outcome
from graspsense.core.values.signals import Pads as Pads
from graspsense.core.values.signals import Phase as Phase
from graspsense.core.values.signals import Reading as Reading
from graspsense.core.values.signals import Samples as Samples
from graspsense.core.values.signals import no_pads as no_pads

# The same kinds, phases and outcomes as plain integers, for laws that are compiled
from graspsense.core.values.signals import APPROACH as APPROACH
from graspsense.core.values.signals import CRUSHED as CRUSHED
from graspsense.core.values.signals import EFFORT as EFFORT
from graspsense.core.values.signals import FORCE as FORCE
from graspsense.core.values.signals import HOLD as HOLD
from graspsense.core.values.signals import NEVER_STEADY as NEVER_STEADY
from graspsense.core.values.signals import NOTHING_THERE as NOTHING_THERE
from graspsense.core.values.signals import ONE_FINGER as ONE_FINGER
from graspsense.core.values.signals import POSITION as POSITION
from graspsense.core.values.signals import RUNNING as RUNNING
from graspsense.core.values.signals import SIDE_IMPACT as SIDE_IMPACT
from graspsense.core.values.signals import SLIPPED as SLIPPED
from graspsense.core.values.signals import SQUEEZE as SQUEEZE
from graspsense.core.values.signals import STEADY as STEADY
from graspsense.core.values.signals import TOO_WIDE as TOO_WIDE
from graspsense.core.values.signals import VELOCITY as VELOCITY
from graspsense.core.control.tick import OPENING as OPENING
from graspsense.core.control.tick import RELEASE as RELEASE
from graspsense.core.control.tick import TARING as TARING

# Sensor backends
from graspsense.core.values.faults import StatusBit as StatusBit
from graspsense.core.values.device import DeviceInfo as DeviceInfo
from graspsense.core.values.mounting import Mounting as Mounting
from graspsense.core.components.roles import ObjectKind as ObjectKind
from graspsense.core.components.roles import SensorBackend as SensorBackend
from graspsense.core.components.roles import Viewer as Viewer
from graspsense.core.components.channels import no_signals as no_signals
from graspsense.core.components.channels import signal_type as signal_type
from graspsense.core.values.fingers import opposed_forces as opposed_forces
from graspsense.core.grasp.reading_thread import ReadingThread as ReadingThread
from graspsense.core.grasp.device_clock import ClockLine as ClockLine
from graspsense.core.grasp.device_clock import DeviceClock as DeviceClock

# Sensor backends that do many grasps at once
from graspsense.core.components.roles import BatchBackend as BatchBackend
from graspsense.core.components.roles import BatchOptions as BatchOptions
from graspsense.core.components.roles import Grasped as Grasped
from graspsense.core.components.roles import SimulationVariant as SimulationVariant
from graspsense.core.grasp.runner import run_uninterrupted as run_uninterrupted

# Identifying an object from recorded squeezes
from graspsense.core.components.identification import CandidateScore as CandidateScore
from graspsense.core.components.identification import Identification as Identification
from graspsense.core.components.identification import IdentifiedParameter as IdentifiedParameter
from graspsense.core.components.identification import PredictiveCheck as PredictiveCheck
from graspsense.core.components.identification import RecordedSqueeze as RecordedSqueeze
from graspsense.core.components.identification import SqueezeFit as SqueezeFit
from graspsense.core.components.identification import Undetermined as Undetermined
from graspsense.core.components.identification import repeatability as repeatability

# Emulated devices
from graspsense.core.components.emulated import EmulatedDevice as EmulatedDevice

# Calibration: from cell counts to newtons
from graspsense.core.grasp.calibration import LoadTable as LoadTable
from graspsense.core.grasp.calibration import edge_force as edge_force
from graspsense.core.grasp.calibration import load_of as load_of
from graspsense.core.grasp.calibration import masked as masked
from graspsense.core.grasp.calibration import pad_force as pad_force
from graspsense.core.grasp.calibration import tare as tare
from graspsense.core.grasp.calibration import zero_of as zero_of
from graspsense.core.grasp.calibration_files import calibrations_of as calibrations_of
from graspsense.core.grasp.calibration_files import stored_friction as stored_friction
from graspsense.core.grasp.calibration_files import stored_tables as stored_tables
from graspsense.core.grasp.calibration_files import stored_zero as stored_zero

# Transmission: from motor revolutions to the gap
from graspsense.core.grasp.transmission import ScrewLinkage as ScrewLinkage
from graspsense.core.grasp.transmission import gap_and_rate as gap_and_rate
from graspsense.core.grasp.transmission import revolutions_at as revolutions_at
from graspsense.core.grasp.transmission import screw_linkage as screw_linkage
from graspsense.core.grasp.transmission import straight_linkage as straight_linkage

# Controllers
from graspsense.core.components.roles import Controller as Controller
from graspsense.core.components.roles import ControllerState as ControllerState
from graspsense.core.components.roles import StepLaw as StepLaw
from graspsense.core.control.free_motion import NOT_FREE as NOT_FREE
from graspsense.core.control.free_motion import FreeLimits as FreeLimits
from graspsense.core.control.free_motion import FreeMotion as FreeMotion

# Contact and rest, the same for controllers and features
from graspsense.core.control.contact import CONTACT_FORCE_N as CONTACT_FORCE_N
from graspsense.core.control.contact import REST_SPEED_M_S as REST_SPEED_M_S
from graspsense.core.control.contact import REST_WINDOW_S as REST_WINDOW_S
from graspsense.core.control.contact import RestState as RestState
from graspsense.core.control.contact import at_rest as at_rest
from graspsense.core.control.contact import both_touch as both_touch
from graspsense.core.control.contact import first_rest as first_rest
from graspsense.core.control.contact import update_rest as update_rest
from graspsense.core.grasp.gap_resolution import GapResolution as GapResolution
from graspsense.core.grasp.gap_resolution import gap_resolution as gap_resolution
from graspsense.core.grasp.gap_resolution import gap_resolution_by_sample as gap_resolution_by_sample
from graspsense.core.grasp.gap_resolution import window_of_rest as window_of_rest

# Feature sets
from graspsense.core.values.features import Features as Features
from graspsense.core.values.features import missing as missing
from graspsense.core.components.roles import FeatureSet as FeatureSet
from graspsense.core.components.compiled_features import CompiledExtraction as CompiledExtraction
from graspsense.core.components.compiled_features import CompiledFeatures as CompiledFeatures
from graspsense.core.components.compiled_features import TickColumns as TickColumns
from graspsense.core.components.compiled_features import columns_of_ticks as columns_of_ticks
from graspsense.core.components.compiled_features import compiled_extraction as compiled_extraction
from graspsense.core.values.trace import ImageTrace as ImageTrace
from graspsense.core.values.trace import SampleTrace as SampleTrace
from graspsense.core.values.trace import Trace as Trace
from graspsense.core.values.trace import TraceRecorder as TraceRecorder
from graspsense.core.values.trace import trace_of as trace_of
from graspsense.core.values.units import in_words as in_words

# Classifiers
from graspsense.core.learn.decision_path import SplitTest as SplitTest
from graspsense.core.learn.decision_path import leaf_reason as leaf_reason
from graspsense.core.learn.decision_path import path_reasons as path_reasons
from graspsense.core.values.features import UNKNOWN as UNKNOWN
from graspsense.core.values.features import FeatureTable as FeatureTable
from graspsense.core.values.features import Prediction as Prediction
from graspsense.core.values.features import table_of as table_of
from graspsense.core.values.nominal import CodedColumn as CodedColumn
from graspsense.core.values.nominal import codes_of as codes_of
from graspsense.core.values.nominal import with_codes as with_codes
from graspsense.core.values.reasons import Contribution as Contribution
from graspsense.core.values.reasons import FeatureValue as FeatureValue
from graspsense.core.values.reasons import Reason as Reason
from graspsense.core.values.reasons import contribution_reasons as contribution_reasons
from graspsense.core.values.reasons import missing_feature as missing_feature
from graspsense.core.components.roles import Classifier as Classifier
from graspsense.core.components.roles import ClassifierConfig as ClassifierConfig
from graspsense.core.learn.stored_values import LARGEST_SEED as LARGEST_SEED
from graspsense.core.learn.stored_values import StoredValueError as StoredValueError
from graspsense.core.learn.stored_values import StoredValues as StoredValues
from graspsense.core.values.tree import TreeNode as TreeNode

# Data sets
from graspsense.core.learn.labelled import ControlFeatures as ControlFeatures
from graspsense.core.learn.labelled import Labelled as Labelled
from graspsense.recording.labelled_recording import LabelledRecording as LabelledRecording
from graspsense.recording.labelled_recording import UnreadableRecording as UnreadableRecording
from graspsense.recording.readable import each_readable as each_readable
from graspsense.recording.replayable import Recording as Recording
from graspsense.sources.grasp_columns import GraspColumns as GraspColumns
from graspsense.sources.grasp_columns import checked_recording as checked_recording
from graspsense.sources.manifest.parquet_format import read_parquet as read_parquet
from graspsense.sources.manifest.steps import squeezes as squeezes
from graspsense.sources.manifest.table import ColumnTable as ColumnTable
from graspsense.store.stored_grasps import StoredGrasp as StoredGrasp

# Tests of a plugin
from graspsense.testing.conformance import parametrize_checks as parametrize_checks
from graspsense.testing.samples import a_trial as a_trial
from graspsense.testing.samples import squeeze as squeeze
from graspsense.testing.samples import sample_table as sample_table
from graspsense.testing.samples import with_channels as with_channels
from graspsense.testing.model_gripper import model_gripper as model_gripper
from graspsense.testing.model_gripper import drive as drive

# Observers
from graspsense.core.values.events import GraspEvent as GraspEvent
from graspsense.core.values.events import event_name as event_name
from graspsense.core.values.trial import RunInfo as RunInfo
from graspsense.core.values.trial import Trial as Trial

# The tick of the runner, for a backend that runs it compiled
from graspsense.core.control.binding import bind as bind
from graspsense.core.control.binding import maker as maker
from graspsense.core.control.guard import GuardParams as GuardParams
from graspsense.core.control.guard import GuardState as GuardState
from graspsense.core.components.run_config import RunConfig as RunConfig
from graspsense.core.grasp.runner import ended_by_itself as ended_by_itself
from graspsense.core.grasp.runner import overdue as overdue
from graspsense.core.grasp.runner import seconds_at_most as seconds_at_most
from graspsense.core.grasp.runner import tick_params as tick_params
from graspsense.core.control.tick import Schedule as Schedule
from graspsense.core.control.tick import TickParams as TickParams
from graspsense.core.control.tick import TickState as TickState
from graspsense.core.control.tick import events_of as events_of
from graspsense.core.control.tick import first_state as first_state
from graspsense.core.control.tick import tick as tick
from graspsense.core.control.tick import CALLED as CALLED
from graspsense.core.control.tick import CLOSES as CLOSES
from graspsense.core.control.tick import FreeRun as FreeRun
from graspsense.core.control.tick import FreeState as FreeState
from graspsense.core.control.tick import FreeTicks as FreeTicks
from graspsense.core.control.tick import after_free as after_free
from graspsense.core.control.tick import free_from as free_from
from graspsense.core.control.tick import free_parts as free_parts
from graspsense.core.control.tick import free_tick as free_tick

# Compiling a function with all that it calls
from graspsense.core.compiling.call_graph import NotCompilable as NotCompilable
from graspsense.core.compiling.call_graph import fingerprint as fingerprint
from graspsense.core.compiling.compiling import CompileOptions as CompileOptions
from graspsense.core.compiling.compiling import Inlining as Inlining
from graspsense.core.compiling.compiling import compile_function as compile_function
from graspsense.core.compiling.compiling import entry_point as entry_point
from graspsense.core.compiling.compiling import first_call as first_call
from graspsense.core.compiling.compiling import is_on_disk as is_on_disk

# Building other components, collecting what other plugins bring, and where to keep files
from graspsense.core.components.config import create as create
from graspsense.core.components.config import recipe_of as recipe_of
from graspsense.core.components.registry import collect as collect
from graspsense.core.files.user_folders import cache_folder as cache_folder
from graspsense.core.files.whole_file import write_whole as write_whole
from graspsense.core.files.closed_paths import is_closed as is_closed
from graspsense.core.files.closed_paths import make_closed as make_closed

# Errors
from graspsense.core.values.errors import ConfigError as ConfigError
from graspsense.core.values.errors import DataDamaged as DataDamaged
from graspsense.core.values.errors import DeviceLost as DeviceLost
from graspsense.core.values.errors import GraspsenseError as GraspsenseError
from graspsense.core.values.errors import NoDevice as NoDevice
from graspsense.core.values.errors import PluginUnavailable as PluginUnavailable
from graspsense.core.values.errors import RecordingEnded as RecordingEnded
from graspsense.core.values.errors import TareRefused as TareRefused
from graspsense.core.values.errors import TooLarge as TooLarge
from graspsense.core.values.errors import UnknownName as UnknownName
from graspsense.core.values.errors import suggestion as suggestion
from graspsense.recording.atomic_file import SaveFailed as SaveFailed
