"""Settings of the PR2 gripper: the device, the interpretation of its numbers, and the emulation."""

from __future__ import annotations

from math import inf
from typing import Any, Literal

from attrs import field, frozen
from attrs.validators import and_, ge, gt, in_, le, max_len

from graspsense.plugin_api import NAMES_INPUT

_USB_ID = and_(ge(0), le(0xFFFF))
_PROBABILITY = and_(ge(0.0), le(1.0))


@frozen(kw_only=True)
class FaultConfig:
    """Faults of the emulated device, by default none. Probabilities are for each report or command."""

    drop: float = field(default=0.0, validator=_PROBABILITY)
    """A report is lost."""
    corrupt: float = field(default=0.0, validator=_PROBABILITY)
    """A bit of a report is flipped."""
    repeat: float = field(default=0.0, validator=_PROBABILITY)
    """A report is repeated."""
    reorder: float = field(default=0.0, validator=_PROBABILITY)
    """A report comes after the next one."""
    delay: float = field(default=0.0, validator=_PROBABILITY)
    """A report comes `delay_s` late."""
    delay_s: float = field(default=0.02, validator=gt(0.0))
    drop_command: float = field(default=0.0, validator=_PROBABILITY)
    """A command is lost, though its write succeeds."""
    corrupt_command: float = field(default=0.0, validator=_PROBABILITY)
    """A bit of a command is flipped."""
    stall_at_s: float = field(default=inf, validator=ge(0.0))
    """Device time from which on nothing passes in either direction, for `stall_s`."""
    stall_s: float = field(default=0.05, validator=gt(0.0))
    unplug_at_s: float = field(default=inf, validator=ge(0.0))
    """Device time at which the cable is pulled."""
    freeze_cell: int = field(default=-1, validator=and_(ge(-1), le(43)))
    """Raw cell that keeps its value from `freeze_at_s` on (-1: none); 0 to 21 left, 22 to 43 right."""
    freeze_at_s: float = field(default=0.0, validator=ge(0.0))
    drift_counts_s: float = 0.0
    """All raw cells drift by this many counts a second."""


@frozen(kw_only=True)
class Pr2Config:
    """A PR2 gripper: the device and its transport, the mounting of its fingertips, and the emulation.

    1209:0001 is the number that pid.codes reserves for private tests. The keys from `pace` on are for
    `transport = "emulated"` only.
    """

    transport: Literal["hidraw", "pyusb", "emulated"] = field(
        default="hidraw", validator=in_(("hidraw", "pyusb", "emulated"))
    )
    """`hidraw`: by hidapi. `pyusb`: by libusb. `emulated`: a gripper in software, in this process."""
    vendor_id: int = field(default=0x1209, validator=_USB_ID)
    product_id: int = field(default=0x0001, validator=_USB_ID)
    serial: str = field(default="", validator=max_len(16))
    """Serial number, if there are several devices; empty: the only one."""
    reconnect_s: float = field(default=5.0, validator=ge(0.0))
    """Time for which opening the gripper again after a loss waits for it."""
    calibration: str = ""
    """Folder of calibrations; empty: that of the user; `none`: run without."""
    swap_fingers: bool = False
    """Exchange the left and the right fingertip of the board."""
    mirror_left: bool = False
    """Swap the left tip's -z and +z sides: sources disagree on where side cell 1 lies."""
    mirror_right: bool = False

    pace: Literal["lock-step", "device"] = field(default="lock-step", validator=in_(("lock-step", "device")))
    """`lock-step`: each read advances the time by a millisecond. `device`: real time, in a thread."""
    body: str = "sim"
    """The backend that the emulated board drives: any one with a virtual clock."""
    body_config: dict[str, Any] = field(factory=dict)
    """Settings of that backend, as in its table [gripper]."""
    object: str | None = field(default=None, metadata=NAMES_INPUT)
    """The object between the fingers of the emulated gripper; None: the default of `body`."""
    transmission: Literal["pr2", "pr2_2009", "pr2_paper"] = field(
        default="pr2", validator=in_(("pr2", "pr2_2009", "pr2_paper"))
    )
    """The linkage that the emulated board reports."""
    faults: FaultConfig = field(factory=FaultConfig)

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
