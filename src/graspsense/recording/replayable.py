"""A recorded grasp as a backend would have delivered it: the readings and the meaning of their numbers."""

from __future__ import annotations

import hashlib
import math
import struct
from array import array
from collections.abc import Iterable, Mapping, Sequence
from itertools import chain
from typing import Any, Final

from attrs import field, frozen

from graspsense.core.components.channels import declared_shape, further, shape_of
from graspsense.core.values.channel import Channel
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.signals import Frame, Image, Reading, Samples

REPLAY_NOTE: Final = "a recording cannot react: the controller's commands have no effect on it"


@frozen(kw_only=True, eq=False)
class Recording:
    """One recorded grasp that can be replayed.

    `units` names the units that are not SI units. `notes` are sentences that a reader of the result needs.
    `rate_hz` is the number of frames per unit of time. `commands` are the values that were commanded after each frame,
    if they are known, and `has_release` states whether the recording goes on until the fingers are open again.
    `channels` are its tactile arrays and further channels. `notices` are sentences on what looks wrong.
    """

    name: str
    readings: tuple[Reading, ...]
    rate_hz: float
    units: Mapping[str, str] = field(factory=dict)
    notes: tuple[str, ...] = ()
    commands: tuple[float, ...] | None = None
    has_release: bool = False
    channels: tuple[Channel, ...] = ()
    notices: tuple[str, ...] = ()


def check_recording(recording: Recording) -> None:
    """Raise DataDamaged if a recording has nothing to replay, or what no gripper can have measured."""
    if not recording.readings:
        raise DataDamaged(f"{recording.name} has no frames")
    cells = len(recording.readings[0].pads.left)
    further_channels = further(recording.channels)
    shapes = [declared_shape(channel) for channel in further_channels]
    pads, signals = struct.Struct(f"<{2 * cells}d"), None
    for k, (frame, image, values) in enumerate(recording.readings, 1):
        try:
            _FRAME.pack(*frame)
            _STATUS.pack(frame.status)
            pads.pack(*image.left, *image.right)
        except (struct.error, TypeError, OverflowError) as error:
            raise DataDamaged(f"{recording.name}: frame {k} is not one of a gripper: {error}") from None
        if values is not signals and not _fits(values, shapes):
            names = ", ".join(channel.name for channel in further_channels) or "none"
            raise DataDamaged(f"{recording.name}: frame {k} has other values than its channels ({names})")
        signals = values
    if not all(math.isfinite(reading.frame.t_s) for reading in recording.readings):
        raise DataDamaged(f"{recording.name}: the time of a frame is not a number")
    if not 0.0 < recording.rate_hz < math.inf:
        raise DataDamaged(f"{recording.name}: its rate is {recording.rate_hz} frames a unit of time")


def _fits(values: Iterable[Any], shapes: Sequence[tuple[int, ...]]) -> bool:
    """Return whether these are the values of channels of these shapes: numbers, images and blocks of samples."""
    if [shape_of(value) for value in values] != shapes:
        return False
    for value in values:
        if isinstance(value, Image):
            numbers: Iterable[float] = value.cells
        elif isinstance(value, Samples):
            numbers = chain.from_iterable(value.values)
        else:
            numbers = (value,)
        try:
            array("d", numbers)
        except TypeError:
            return False
    return True


_FRAME: Final = struct.Struct(f"<{len(Frame._fields)}d")
_STATUS: Final = struct.Struct("<q")


def content_sha256(recording: Recording) -> str:
    """Return a hash of the frames, images and channels: equal for the same grasp under another file name or label."""
    content = hashlib.sha256()
    counter = 0
    for reading in recording.readings:
        content.update(_FRAME.pack(*reading.frame))
        pads = reading.pads
        if pads.counter != counter:
            counter = pads.counter
            content.update(struct.pack(f"<{2 * len(pads.left)}d", *pads.left, *pads.right))
        if reading.signals:
            content.update(repr(tuple(reading.signals)).encode())
    return content.hexdigest()
