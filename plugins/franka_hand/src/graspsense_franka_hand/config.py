"""Settings of a Franka Hand: its address, its calibration, and the emulation."""

from __future__ import annotations

from typing import ClassVar, Literal

from attrs import frozen

from graspsense.gripper_api import EmulatorFaults, EmulatorSettings, own_keys_first
from graspsense.plugin_api import NAMES_INPUT, setting


@frozen(kw_only=True)
class FrankaFaults(EmulatorFaults):
    """Faults of the emulated hand, by default none. Times are counted from its start."""

    mood: Literal["well", "silent", "damaged", "late", "old"] = setting(
        default="well",
        meaning="silent: no state and no reply. damaged: states are cut, replies are wrong. late: all comes after "
        "late_s. old: it speaks another version of the protocol.",
    )


@frozen(kw_only=True, field_transformer=own_keys_first)
class FrankaConfig(EmulatorSettings):
    """A Franka Hand; with `host = "emulated"` a hand in software."""

    where: ClassVar[str] = "host"
    host: str = setting(
        default="172.16.0.2",
        meaning="Address of the robot's control; or emulated, a hand in software.",
    )
    calibration: str = setting(
        default="",
        effect=NAMES_INPUT,
        meaning="Folder of calibrations; empty: that of the user; none: run without.",
    )
    faults: FrankaFaults = setting(factory=FrankaFaults, meaning="Emulated only: faults of the hand.")
