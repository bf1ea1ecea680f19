"""A gripper as it was opened."""

from __future__ import annotations

from collections.abc import Mapping
from math import nan
from typing import Any, Literal

from attrs import field, frozen

from graspsense.core.values.channel import Channel
from graspsense.core.values.faults import StatusBit
from graspsense.core.values.mounting import Mounting
from graspsense.core.values.signals import Command


@frozen(kw_only=True)
class DeviceInfo:
    """A gripper as it was opened.

    `simulated` is True where forces and motion come from a model, False where a physical gripper measures them.
    With a `virtual` clock, apply and read advance the time by one tick without waiting; with a `device` clock, a
    read waits for the next frame. `opening` is the command that opens the fingers, None for a recording, and
    `relaxed` the command that exerts no force. `has_release` is True for a recording that goes on until the fingers
    are open again. `tare_images` is the number of unloaded cell images that a tare needs, 0 if the gripper is not
    tared. `calibration` maps each stored calibration in use to the hash of its content. `numbers` state what the
    raw numbers of the device mean (counts per newton, transmission); a stored calibration is valid for these only.
    `units` names the units that are not SI, as in a recording: `{"t": "frame"}`. `notes` are sentences that a
    reader of the result must know. `channels` are those of the backend; the runner sets them where they are empty.
    `mounting` says where the frames of the tool and of the fingers are; the settings may add to it (`run.mounting`).

    `friction_n` is the greatest friction of the drive while it closes (N, on the scale of the effort), measured or
    declared: the guard adds it to the force that the controller asks for. `open_gap_m` is the gap of open fingers where
    `opening` is no position (m, NaN: not known): another one is told. `status_bits` says what the bits of
    `Frame.status` mean. `harmless` is True where the fingers can hurt nothing, as in a pure model: the guard then only
    keeps commands within the limits of the device. `recorded_with` has the settings of the gripper and the controller
    that made a recording, as far as they are known.
    """

    name: str
    serial: str = ""
    firmware: str = ""
    clock: Literal["virtual", "device"]
    simulated: bool = False
    rate_hz: float = field(converter=float)
    effort_limit_n: float = field(converter=float)
    speed_limit_m_s: float = field(converter=float)
    opening: Command | None
    relaxed: Command
    has_release: bool = False
    tare_images: int = 0
    calibration: Mapping[str, str] = field(factory=dict)
    numbers: Mapping[str, float | str] = field(factory=dict)
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()
    channels: tuple[Channel, ...] = ()
    mounting: Mapping[str, Mounting] = field(factory=dict)
    friction_n: float = field(default=0.0, converter=float)
    open_gap_m: float = field(default=nan, converter=float)
    status_bits: tuple[StatusBit, ...] = ()
    harmless: bool = False
    recorded_with: Mapping[str, Mapping[str, Any]] = field(factory=dict)
