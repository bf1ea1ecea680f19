"""Settings of the PR2 gripper: the device, the interpretation of its numbers, and the emulation."""

from __future__ import annotations

from math import inf
from typing import Any, ClassVar, Final, Literal

from attrs import fields_dict, frozen
from attrs.validators import max_len

from graspsense.gripper_api import EmulatorSettings, own_keys_first
from graspsense.plugin_api import setting
from graspsense_pr2_gripper.protocol import REPORT_SIZE, Identity

IDENTITY_NUMBERS: Final = Identity._fields[Identity._fields.index("pad_counts_per_n") :]
"""The fields of the feature report that `faults.identity` may set."""


def _probability(meaning: str) -> Any:
    return setting(default=0.0, minimum=0.0, maximum=1.0, meaning=meaning)


def _beginning(what: str) -> Any:
    return setting(default=0.0, unit="s", minimum=0.0, meaning=f"Device time from which on {what}.")


@frozen(kw_only=True)
class FaultConfig:
    """Faults of the emulated device, by default none. Probabilities are for each report or command.

    A time `..._at_s` is a device time, from which on the fault lasts. Left and right are those of the board.
    """

    drop: float = _probability("Probability that a report is lost.")
    corrupt: float = _probability("Probability that a bit of a report is flipped.")
    repeat: float = _probability("Probability that a report is repeated.")
    reorder: float = _probability("Probability that a report comes after the next one.")
    delay: float = _probability("Probability that a report comes delay_s late.")
    delay_s: float = setting(
        default=0.02,
        unit="s",
        above=0.0,
        plausible=(1e-4, 10.0),
        meaning="Time by which a delayed report is late.",
    )
    drop_command: float = _probability("Probability that a command is lost, though its write succeeds.")
    corrupt_command: float = _probability("Probability that a bit of a command is flipped.")
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
    freeze_at_s: float = _beginning("freeze_cell keeps its value")
    drift_counts_s: float = setting(
        default=0.0,
        unit="counts/s",
        meaning="Drift of the raw cells of pad_side from pad_at_s on.",
    )
    pad_fault: Literal["none", "absent", "stuck", "numb", "zero"] = setting(
        default="none",
        meaning="absent: the status bit of a fingertip is set. stuck: its cells keep their values. numb: they do so "
        "but for noise. zero: they read 0.",
    )
    pad_side: Literal["left", "right", "both"] = setting(
        default="both",
        meaning="Fingertip with pad_fault or drift_counts_s.",
    )
    pad_at_s: float = _beginning("pad_fault and drift_counts_s act")
    image_fault: Literal["none", "frozen", "stale"] = setting(
        default="none",
        meaning="frozen: the counter of cell images stands still. stale: so it does, and the age of the image rises.",
    )
    image_at_s: float = _beginning("image_fault acts")
    status_bits: int = setting(
        default=0,
        minimum=0,
        maximum=0xFFFF,
        meaning="Bits that are set in the status of each report from status_at_s on.",
    )
    status_at_s: float = _beginning("status_bits are set")
    motor_gain: float = setting(
        default=1.0,
        plausible=(-10.0, 10.0),
        meaning="Applied effort over commanded effort from motor_at_s on; below 0: the motor turns the wrong way.",
    )
    motor_at_s: float = _beginning("motor_gain acts")
    effort_report_gain: float = setting(
        default=1.0,
        plausible=(-10.0, 10.0),
        meaning="Reported effort over applied effort from effort_report_at_s on.",
    )
    effort_report_at_s: float = _beginning("effort_report_gain acts")
    clock_rate: float = setting(
        default=1.0,
        minimum=0.0,
        plausible=(0.0, 100.0),
        meaning="Rate of the clock of the device from clock_at_s on; 0: it stands still.",
    )
    clock_at_s: float = _beginning("clock_rate acts")
    identity: dict[str, Any] = setting(
        factory=dict,
        meaning="Numbers of the feature report that replace those of the board, under their names in "
        "specs/pr2_hid.md: {watchdog_ms = 65535}.",
    )
    feature_bytes: int = setting(
        default=REPORT_SIZE,
        minimum=0,
        maximum=REPORT_SIZE,
        meaning="Number of bytes of the feature report that arrive.",
    )

    def __attrs_post_init__(self) -> None:
        for key, needed in _WITHOUT_EFFECT_ALONE.items():
            given = [
                name
                for name in (key, *needed)
                if getattr(self, name) != fields_dict(FaultConfig)[name].default
            ]
            if given == [key]:
                raise ValueError(
                    f"{key} has no effect alone: set {' or '.join(needed)} too, or leave {key} out"
                )
        for name, value in self.identity.items():
            if name not in IDENTITY_NUMBERS:
                raise ValueError(
                    f"identity has no number {name!r}: it has {', '.join(IDENTITY_NUMBERS)} (specs/pr2_hid.md)"
                )
            if type(value) is not int:
                raise ValueError(f"identity.{name} is {value!r}: it must be a whole number")


_WITHOUT_EFFECT_ALONE: Final = {
    "pad_side": ("pad_fault", "drift_counts_s"),
    "pad_at_s": ("pad_fault", "drift_counts_s"),
    "image_at_s": ("image_fault",),
    "status_at_s": ("status_bits",),
    "motor_at_s": ("motor_gain",),
    "effort_report_at_s": ("effort_report_gain",),
    "clock_at_s": ("clock_rate",),
}
"""Keys of a fault that say where or when, each with the keys that say what."""


@frozen(kw_only=True, field_transformer=own_keys_first)
class Pr2Config(EmulatorSettings):
    """A PR2 gripper: the device and its transport, the mounting of its fingertips, and the emulation.

    1209:0001 is the number that pid.codes reserves for private tests. The keys from `pace` on are for
    `transport = "emulated"` only.
    """

    where: ClassVar[str] = "transport"
    emulated_only: ClassVar[tuple[str, ...]] = ("pace", "transmission", "faults")

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
    transmission: Literal["pr2", "pr2_2009", "pr2_paper"] = setting(
        default="pr2",
        meaning="Emulated only: the linkage that the emulated board reports.",
    )
    faults: FaultConfig = setting(factory=FaultConfig, meaning="Emulated only: faults of the device.")
