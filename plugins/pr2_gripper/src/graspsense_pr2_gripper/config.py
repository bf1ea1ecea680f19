"""Settings of the PR2 gripper: the device, the interpretation of its numbers, and the emulation."""

from __future__ import annotations

from math import inf
from typing import Any, Literal

from attrs import frozen
from attrs.validators import max_len

from graspsense.plugin_api import NAMES_INPUT, setting


@frozen(kw_only=True)
class FaultConfig:
    """Faults of the emulated device, by default none. Probabilities are for each report or command."""

    drop: float = setting(default=0.0, minimum=0.0, maximum=1.0, meaning="Probability that a report is lost.")
    corrupt: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a bit of a report is flipped.",
    )
    repeat: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a report is repeated.",
    )
    reorder: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a report comes after the next one.",
    )
    delay: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a report comes delay_s late.",
    )
    delay_s: float = setting(
        default=0.02,
        unit="s",
        above=0.0,
        plausible=(1e-4, 10.0),
        meaning="Time by which a delayed report is late.",
    )
    drop_command: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a command is lost, though its write succeeds.",
    )
    corrupt_command: float = setting(
        default=0.0,
        minimum=0.0,
        maximum=1.0,
        meaning="Probability that a bit of a command is flipped.",
    )
    stall_at_s: float = setting(
        default=inf,
        unit="s",
        minimum=0.0,
        meaning="Device time from which on nothing passes in either direction, for stall_s; inf: never.",
    )
    stall_s: float = setting(
        default=0.05,
        unit="s",
        above=0.0,
        plausible=(1e-3, 60.0),
        meaning="Duration of the stall.",
    )
    unplug_at_s: float = setting(
        default=inf,
        unit="s",
        minimum=0.0,
        meaning="Device time at which the cable is pulled; inf: never.",
    )
    freeze_cell: int = setting(
        default=-1,
        minimum=-1,
        maximum=43,
        meaning="Raw cell that keeps its value from freeze_at_s on (-1: none); 0 to 21 left, 22 to 43 right.",
    )
    freeze_at_s: float = setting(
        default=0.0,
        unit="s",
        minimum=0.0,
        meaning="Device time from which on freeze_cell keeps its value.",
    )
    drift_counts_s: float = setting(default=0.0, unit="counts/s", meaning="Drift of all raw cells.")


@frozen(kw_only=True)
class Pr2Config:
    """A PR2 gripper: the device and its transport, the mounting of its fingertips, and the emulation.

    1209:0001 is the number that pid.codes reserves for private tests. The keys from `pace` on are for
    `transport = "emulated"` only.
    """

    transport: Literal["hidraw", "pyusb", "emulated"] = setting(
        default="hidraw",
        meaning="hidraw: by hidapi. pyusb: by libusb. emulated: a gripper in software, in this process.",
    )
    vendor_id: int = setting(default=0x1209, minimum=0, maximum=0xFFFF, meaning="USB vendor id of the board.")
    product_id: int = setting(
        default=0x0001,
        minimum=0,
        maximum=0xFFFF,
        meaning="USB product id of the board.",
    )
    serial: str = setting(
        default="",
        validator=max_len(16),
        meaning="Serial number, if there are several devices; empty: the only one.",
    )
    reconnect_s: float = setting(
        default=5.0,
        unit="s",
        minimum=0.0,
        plausible=(0.0, 600.0),
        meaning="Time for which opening the gripper again after a loss waits for it.",
    )
    calibration: str = setting(
        default="",
        meaning="Folder of calibrations; empty: that of the user; none: run without.",
    )
    swap_fingers: bool = setting(
        default=False,
        meaning="Exchange the left and the right fingertip of the board.",
    )
    mirror_left: bool = setting(
        default=False,
        meaning="Swap the left tip's -z and +z sides: sources disagree on where side cell 1 lies.",
    )
    mirror_right: bool = setting(default=False, meaning="Swap the right tip's -z and +z sides.")
    accelerometer: bool = setting(
        default=True,
        meaning="Whether the accelerometer of the palm is read, as the channel acceleration; false: there is none.",
    )
    pace: Literal["lock-step", "device"] = setting(
        default="lock-step",
        meaning="Emulated only. lock-step: each read advances the time by a millisecond. device: real time, in a "
        "thread.",
    )
    body: str = setting(
        default="sim",
        meaning="Emulated only: the backend that the emulated board drives, any one with a virtual clock.",
    )
    body_config: dict[str, Any] = setting(
        factory=dict,
        meaning="Emulated only: settings of that backend, as in its table [gripper].",
    )
    object: str | None = setting(
        default=None,
        effect=NAMES_INPUT,
        meaning="Emulated only: the object between the fingers; not set: the default of body.",
    )
    transmission: Literal["pr2", "pr2_2009", "pr2_paper"] = setting(
        default="pr2",
        meaning="Emulated only: the linkage that the emulated board reports.",
    )
    faults: FaultConfig = setting(factory=FaultConfig, meaning="Emulated only: faults of the device.")

    def __attrs_post_init__(self) -> None:
        if self.transport == "emulated":
            return
        defaults = Pr2Config(transport="emulated")
        for key in ("object", "pace", "body", "body_config", "transmission", "faults"):
            if getattr(self, key) != getattr(defaults, key):
                raise ValueError(
                    f"{key} is for the emulated gripper, but transport is {self.transport!r}: leave it out, or set "
                    "gripper.transport to emulated"
                )
