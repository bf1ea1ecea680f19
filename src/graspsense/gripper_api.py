"""What some grippers need besides `graspsense.plugin_api`: calibration, clocks, more fingers, emulated devices."""

from __future__ import annotations

from typing import Final

from graspsense.core.components.lazy_names import LazyNames, Table

_TABLE: Final[Table] = {
    "Finding devices and their faults": {
        "core.components.entries": ("FoundDevice", "Finding"),
        "core.components.serial_converters": (
            "converter_findings",
            "found_converters",
            "port_failed",
            "why_not_opened",
        ),
        "core.components.caller": ("set_option",),
        "core.values.faults": ("StatusBit",),
        "core.values.errors": ("TareRefused", "GraspsenseError"),
    },
    "Emulated devices": {
        "core.components.emulated": ("EmulatedDevice",),
        "core.components.emulated_port": ("EmulatedPort",),
        "core.components.emulated_serial": ("EmulatedSerial", "EmulatorFaults", "SerialFaults"),
        "core.grasp.emulated_body": (
            "BackendWithEmulator",
            "EmulatorSettings",
            "opened_body",
            "own_keys_first",
        ),
        "core.grasp.emulated_fingers": ("EmulatedFingers", "FingerTarget"),
        "core.components.entries": ("EmulatorEntry",),
    },
    "Polling, reading threads and clocks of devices": {
        "core.grasp.polling": ("Polling",),
        "core.grasp.reading_thread": ("ReadingThread",),
        "core.grasp.device_clock": ("DeviceClock", "clock_report"),
        "core.grasp.dead_man_switch": ("DeadManSwitch",),
    },
    "Fingers, and where the gripper is mounted": {
        "core.values.fingers": ("FingerForce", "opposed_forces"),
        "core.values.mounting": ("Mounting",),
    },
    "Signals of grippers that lack some": {
        "core.values.signals": ("NO_GAP", "no_pads"),
        "core.components.channels": ("no_signals",),
    },
    "Calibration: from cell counts to newtons": {
        "core.grasp.calibration": (
            "LoadTable",
            "MotorTable",
            "asked_force",
            "cells_force",
            "edge_force",
            "load_of",
            "load_within",
            "masked",
            "motor_at",
            "pad_force",
            "tare",
            "zero_of",
        ),
        "core.grasp.calibration_files": (
            "calibrations_of",
            "stored_delivered_force",
            "stored_friction",
            "stored_gain",
            "stored_motor_tables",
            "stored_tables",
            "stored_zero",
        ),
    },
    "Transmission: from motor revolutions to the gap": {
        "core.grasp.transmission": ("ScrewLinkage", "gap_and_rate", "revolutions_at", "screw_linkage"),
    },
    "Rest where the gap is coarse": {
        "core.grasp.gap_resolution": (
            "GapResolution",
            "gap_resolution",
            "gap_resolution_by_sample",
            "window_of_rest",
        ),
        "core.control.contact": ("first_rest",),
    },
    "Observers of a grasp while it goes on, and commands that grasp": {
        "core.components.entries": ("LiveObserverEntry",),
        "live.feeds": ("LiveFeed",),
        "core.pipeline.pipeline": ("Pipeline", "load_pipeline"),
        "core.grasp.interrupts": ("Interrupts",),
    },
    "Readers of tables with several squeezes, and writers of data sets": {
        "store.stored_grasps": ("StoredGrasp",),
        "recording.atomic_file": ("SaveFailed",),
        "sources.manifest.parquet_format": ("read_parquet",),
        "sources.manifest.steps": ("squeezes",),
        "sources.manifest.table": ("ColumnTable",),
        "core.values.errors": ("TooLarge",),
    },
    "Numbers in ROS messages": {
        "sources.manifest.message_numbers": ("MessageNumber", "message_columns"),
    },
    "A grasp that another program makes": {
        "core.pipeline.anytime": ("anytime_of",),
        "core.learn.model": ("model_for",),
    },
    "Recordings as they are replayed": {
        "recording.replayable": ("Recording",),
        "core.values.errors": ("RecordingEnded",),
    },
    "Commands, phases and outcomes as enumerations, and the outcomes that few laws report": {
        "core.values.signals": ("Phase", "Outcome", "TOO_WIDE", "SIDE_IMPACT", "CRUSHED", "SLIPPED"),
    },
}

PUBLIC: Final = LazyNames("graspsense.gripper_api", _TABLE)

__all__ = PUBLIC.names
