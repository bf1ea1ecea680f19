"""The names of graspsense.gripper_api, for type checkers and for `core/components/lazy_names.py`."""

# Finding devices and their faults
from graspsense.core.components.entries import FoundDevice as FoundDevice
from graspsense.core.components.entries import Finding as Finding
from graspsense.core.drivers.discovery_hooks import discovery_hooks as discovery_hooks
from graspsense.core.drivers.serial_converters import GripperAtPort as GripperAtPort
from graspsense.core.drivers.serial_converters import lasting_port as lasting_port
from graspsense.core.drivers.serial_converters import port_failed as port_failed
from graspsense.core.drivers.serial_converters import why_not_opened as why_not_opened
from graspsense.core.components.caller import set_option as set_option
from graspsense.core.values.faults import StatusBit as StatusBit
from graspsense.core.values.errors import TareRefused as TareRefused
from graspsense.core.values.errors import GraspsenseError as GraspsenseError

# Emulated devices
from graspsense.core.drivers.emulated_serial import EmulatedDevice as EmulatedDevice
from graspsense.core.drivers.emulated_serial import EmulatedPort as EmulatedPort
from graspsense.core.drivers.emulated_serial import EmulatedSerial as EmulatedSerial
from graspsense.core.drivers.emulated_serial import EmulatorFaults as EmulatorFaults
from graspsense.core.drivers.emulated_serial import SerialFaults as SerialFaults
from graspsense.core.drivers.emulated_body import BackendWithEmulator as BackendWithEmulator
from graspsense.core.drivers.emulated_body import EmulatorSettings as EmulatorSettings
from graspsense.core.drivers.emulated_body import opened_body as opened_body
from graspsense.core.drivers.emulated_body import own_keys_first as own_keys_first
from graspsense.core.drivers.emulated_body import LockStepDevice as LockStepDevice
from graspsense.core.drivers.emulated_body import EmulatedFingers as EmulatedFingers
from graspsense.core.drivers.emulated_body import FingerTarget as FingerTarget
from graspsense.core.drivers.emulated_body import finger_target as finger_target
from graspsense.core.components.entries import EmulatorEntry as EmulatorEntry

# Polling, reading threads and clocks of devices
from graspsense.core.drivers.polling import Clock as Clock
from graspsense.core.drivers.polling import Polling as Polling
from graspsense.core.drivers.reading_thread import ReadingThread as ReadingThread
from graspsense.core.drivers.device_clock import DeviceClock as DeviceClock
from graspsense.core.drivers.device_clock import clock_report as clock_report
from graspsense.core.drivers.dead_man_switch import DeadManSwitch as DeadManSwitch

# Fingers, and where the gripper is mounted
from graspsense.core.values.fingers import FingerForce as FingerForce
from graspsense.core.values.fingers import opposed_forces as opposed_forces
from graspsense.core.values.mounting import Mounting as Mounting

# Signals of grippers that lack some
from graspsense.core.values.signals import NO_GAP as NO_GAP
from graspsense.core.values.signals import no_pads as no_pads
from graspsense.core.components.channels import no_signals as no_signals

# Calibration: from cell counts to newtons
from graspsense.core.grasp.calibration import SCALE_UNSEEN as SCALE_UNSEEN
from graspsense.core.grasp.calibration import LoadTable as LoadTable
from graspsense.core.grasp.calibration import MotorTable as MotorTable
from graspsense.core.grasp.calibration import asked_force as asked_force
from graspsense.core.grasp.calibration import cells_force as cells_force
from graspsense.core.grasp.calibration import edge_force as edge_force
from graspsense.core.grasp.calibration import load_of as load_of
from graspsense.core.grasp.calibration import load_within as load_within
from graspsense.core.grasp.calibration import masked as masked
from graspsense.core.grasp.calibration import motor_at as motor_at
from graspsense.core.grasp.calibration import pad_force as pad_force
from graspsense.core.grasp.calibration import tare as tare
from graspsense.core.grasp.calibration import zero_of as zero_of
from graspsense.core.grasp.calibration_files import calibrations_of as calibrations_of
from graspsense.core.grasp.calibration_files import stored_delivered_force as stored_delivered_force
from graspsense.core.grasp.calibration_files import stored_friction as stored_friction
from graspsense.core.grasp.calibration_files import stored_gain as stored_gain
from graspsense.core.grasp.calibration_files import stored_motor_tables as stored_motor_tables
from graspsense.core.grasp.calibration_files import stored_tables as stored_tables
from graspsense.core.grasp.calibration_files import stored_zero as stored_zero

# Transmission: from motor revolutions to the gap
from graspsense.core.drivers.transmission import ScrewLinkage as ScrewLinkage
from graspsense.core.drivers.transmission import gap_and_rate as gap_and_rate
from graspsense.core.drivers.transmission import revolutions_at as revolutions_at
from graspsense.core.drivers.transmission import screw_linkage as screw_linkage

# Contact, and rest where the gap is coarse
from graspsense.core.control.contact import either_touches as either_touches
from graspsense.core.control.contact import RestCourse as RestCourse
from graspsense.core.control.contact import follow_rest as follow_rest
from graspsense.core.grasp.gap_resolution import GapResolution as GapResolution
from graspsense.core.grasp.gap_resolution import gap_resolution as gap_resolution
from graspsense.core.grasp.gap_resolution import window_of_rest as window_of_rest
from graspsense.core.control.contact import MOVED_M as MOVED_M
from graspsense.core.control.contact import first_rest as first_rest
from graspsense.core.control.tick import OPEN_SPEED_M_S as OPEN_SPEED_M_S
from graspsense.core.control.tick import OPEN_WINDOW_S as OPEN_WINDOW_S

# Observers of a running grasp, and commands that grasp
from graspsense.core.components.entries import LiveObserverEntry as LiveObserverEntry
from graspsense.live.feeds import LiveFeed as LiveFeed
from graspsense.core.pipeline.pipeline import Pipeline as Pipeline
from graspsense.core.pipeline.pipeline import load_pipeline as load_pipeline
from graspsense.core.grasp.interrupts import Interrupts as Interrupts

# Readers of tables with several squeezes, and writers of data sets
from graspsense.store.stored_grasps import StoredGrasp as StoredGrasp
from graspsense.core.files.whole_file import SaveFailed as SaveFailed
from graspsense.sources.formats.parquet_format import read_parquet as read_parquet
from graspsense.sources.manifest.steps import squeezes as squeezes
from graspsense.sources.formats.table import ColumnTable as ColumnTable
from graspsense.core.values.errors import TooLarge as TooLarge

# Numbers in ROS messages
from graspsense.sources.manifest.message_numbers import MessageNumber as MessageNumber
from graspsense.sources.manifest.message_numbers import message_columns as message_columns

# A grasp that another program makes
from graspsense.core.pipeline.anytime import anytime_of as anytime_of
from graspsense.core.pipeline.pipeline import model_for as model_for
from graspsense.core.grasp.protection.protection import Protection as Protection

# Recordings as they are replayed
from graspsense.recording.replayable import Recording as Recording
from graspsense.core.values.errors import RecordingEnded as RecordingEnded

# Commands, phases and outcomes as enumerations, and the outcomes that few laws report
from graspsense.core.values.signals import Phase as Phase
from graspsense.core.values.signals import Outcome as Outcome
from graspsense.core.values.signals import TOO_WIDE as TOO_WIDE
from graspsense.core.values.signals import SIDE_IMPACT as SIDE_IMPACT
from graspsense.core.values.signals import CRUSHED as CRUSHED
from graspsense.core.values.signals import SLIPPED as SLIPPED
