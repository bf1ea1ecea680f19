"""The names of graspsense.plugin_api, for type checkers and for `core/components/lazy_names.py`."""

# Declaring what a plugin brings
from graspsense.core.components.hookspecs import hookimpl as hookimpl
from graspsense.core.components.entries import SensorBackendEntry as SensorBackendEntry
from graspsense.core.components.entries import ControllerEntry as ControllerEntry
from graspsense.core.components.entries import FeatureSetEntry as FeatureSetEntry
from graspsense.core.components.entries import Feature as Feature
from graspsense.core.components.entries import ClassifierEntry as ClassifierEntry
from graspsense.core.components.entries import DatasetEntry as DatasetEntry
from graspsense.core.components.entries import PipelineEntry as PipelineEntry
from graspsense.core.components.entries import CommandEntry as CommandEntry
from graspsense.core.components.setting import setting as setting
from graspsense.core.components.setting import NAMES_INPUT as NAMES_INPUT
from graspsense.core.settings.selected import create as create

# What a gripper measures
from graspsense.core.values.channel import Channel as Channel
from graspsense.core.values.channel import FastChannel as FastChannel
from graspsense.core.values.channel import TactileArray as TactileArray
from graspsense.core.values.device import DeviceInfo as DeviceInfo
from graspsense.core.components.roles import ObjectKind as ObjectKind

# Signals between a gripper and a controller
from graspsense.core.values.signals import Command as Command
from graspsense.core.values.signals import Frame as Frame
from graspsense.core.values.signals import Image as Image
from graspsense.core.values.signals import NO_PADS as NO_PADS
from graspsense.core.values.signals import Pads as Pads
from graspsense.core.values.signals import Reading as Reading
from graspsense.core.values.signals import Samples as Samples
from graspsense.core.components.channels import signal_type as signal_type

# The roles
from graspsense.core.components.roles import SensorBackend as SensorBackend
from graspsense.core.components.roles import Controller as Controller
from graspsense.core.components.roles import FeatureSet as FeatureSet
from graspsense.core.components.roles import Classifier as Classifier
from graspsense.core.components.roles import ClassifierConfig as ClassifierConfig

# Kinds of command, phases and outcomes as integers, for laws that are compiled
from graspsense.core.values.signals import EFFORT as EFFORT
from graspsense.core.values.signals import VELOCITY as VELOCITY
from graspsense.core.values.signals import POSITION as POSITION
from graspsense.core.values.signals import FORCE as FORCE
from graspsense.core.values.signals import APPROACH as APPROACH
from graspsense.core.values.signals import SQUEEZE as SQUEEZE
from graspsense.core.values.signals import HOLD as HOLD
from graspsense.core.values.signals import RUNNING as RUNNING
from graspsense.core.values.signals import STEADY as STEADY
from graspsense.core.values.signals import NEVER_STEADY as NEVER_STEADY
from graspsense.core.values.signals import NOTHING_THERE as NOTHING_THERE
from graspsense.core.values.signals import ONE_FINGER as ONE_FINGER
from graspsense.core.control.tick import RELEASE as RELEASE

# Contact and rest, the same for controllers and features
from graspsense.core.control.contact import CONTACT_FORCE_N as CONTACT_FORCE_N
from graspsense.core.control.contact import REST_SPEED_M_S as REST_SPEED_M_S
from graspsense.core.control.contact import REST_WINDOW_S as REST_WINDOW_S
from graspsense.core.control.contact import RestState as RestState
from graspsense.core.control.contact import at_rest as at_rest
from graspsense.core.control.contact import both_touch as both_touch
from graspsense.core.control.contact import update_rest as update_rest

# Features and classes
from graspsense.core.values.features import Features as Features
from graspsense.core.values.features import FeatureTable as FeatureTable
from graspsense.core.values.features import Prediction as Prediction
from graspsense.core.values.features import missing as missing
from graspsense.core.learn.stored_values import StoredValues as StoredValues
from graspsense.core.values.trace import Trace as Trace

# Readers of data sets
from graspsense.sources.columns.grasp_columns import GraspColumns as GraspColumns
from graspsense.sources.columns.grasp_columns import checked_recording as checked_recording
from graspsense.recording.labelled_recording import LabelledRecording as LabelledRecording
from graspsense.recording.labelled_recording import UnreadableRecording as UnreadableRecording
from graspsense.recording.readable import each_readable as each_readable

# Observers
from graspsense.core.values.signals import GraspEvent as GraspEvent
from graspsense.core.values.trial import RunInfo as RunInfo
from graspsense.core.values.trial import Trial as Trial

# Errors
from graspsense.core.values.errors import ConfigError as ConfigError
from graspsense.core.values.errors import DataDamaged as DataDamaged
from graspsense.core.values.errors import DeviceLost as DeviceLost
from graspsense.core.values.errors import NoDevice as NoDevice
from graspsense.core.values.errors import PluginUnavailable as PluginUnavailable
from graspsense.core.values.errors import UnknownName as UnknownName
