"""Settings of the PR2 gripper: which device, how its numbers are read, and the emulated one."""

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
    """How the emulated device misbehaves; nothing of it by default. Probabilities are for each report or command."""

    drop: float = field(default=0.0, validator=_PROBABILITY)
    """A report is lost."""
    corrupt: float = field(default=0.0, validator=_PROBABILITY)
    """A bit of a report is flipped."""
    repeat: float = field(default=0.0, validator=_PROBABILITY)
    """A report comes twice."""
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
    """Device time at which nothing passes in either direction any more, for `stall_s`."""
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
    """A PR2 gripper: which device over which wire, how its fingertips are mounted, and what is emulated.

    1209:0001 is the number that pid.codes reserves for private tests. The keys from `pace` on are for
    `transport = "emulated"` only.
    """

    transport: Literal["hidraw", "pyusb", "emulated"] = field(
        default="hidraw", validator=in_(("hidraw", "pyusb", "emulated"))
    )
    """`hidraw`: through hidapi. `pyusb`: through libusb. `emulated`: a software gripper in this process."""
    vendor_id: int = field(default=0x1209, validator=_USB_ID)
    product_id: int = field(default=0x0001, validator=_USB_ID)
    serial: str = field(default="", validator=max_len(16))
    """Which one where there are several; empty: the only one."""
    reconnect_s: float = field(default=5.0, validator=ge(0.0))
    """After a loss, how long opening the same gripper again waits for it to come back."""
    calibration: str = ""
    """Folder of calibrations; empty: the user's own; `none`: run without."""
    swap_fingers: bool = False
    """Take the board's left fingertip for the right one."""
    mirror_left: bool = False
    """Swap the left tip's -z and +z sides: sources disagree on where side cell 1 lies."""
    mirror_right: bool = False

    pace: Literal["lock-step", "device"] = field(default="lock-step", validator=in_(("lock-step", "device")))
    """`lock-step`: a millisecond passes with each read. `device`: it runs by the clock, in a thread."""
    body: str = "sim"
    """What the emulated board drives: any gripper backend with a virtual clock."""
    body_config: dict[str, Any] = field(factory=dict)
    """Keys of that backend, as under its own [gripper]."""
    object: str | None = field(default=None, metadata=NAMES_INPUT)
    """What stands between the emulated gripper's fingers; None leaves it to the body."""
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
