"""A recorded grasp as a backend would have delivered it: the readings and the meaning of their numbers.

Recordings are of the same grasp if their curves are equal, or one is the part that a damaged file had left.
"""

from __future__ import annotations

import hashlib
import math
import struct
from collections.abc import Iterable, Mapping, Sequence
from functools import cached_property
from typing import Any, Final

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.core.components.channels import dtype_of
from graspsense.core.components.delivered import Delivered
from graspsense.core.values.channel import FLOATS, Channel
from graspsense.core.values.errors import DataDamaged
from graspsense.core.values.mounting import Mounting
from graspsense.core.values.signals import APPROACH, CHANNELS, Frame, GraspEvent, Image, Reading
from graspsense.core.values.trace import SI_UNITS, Trace, trace_of

_FRAME: Final = struct.Struct(f"<{len(Frame._fields)}d")
ALWAYS: Final = frozenset({"gap", "velocity", "force_left", "force_right"})
"""The channels of a frame that every recording has, by which a control law follows it."""
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
    mounting: Mapping[str, Mounting] = field(factory=dict)
    """Where the frames of tool and fingers were, if this is known."""
    events: Mapping[str, tuple[GraspEvent, ...]] = field(factory=dict)
    """The events that others labelled in it, by their names; one without events was looked for and did not happen."""
    recorded_with: Mapping[str, Mapping[str, Any]] = field(factory=dict)
    """The settings that it was recorded with, if they are known."""

    @cached_property
    def frames(self) -> NDArray[np.float64]:
        """The numbers of its frames: shape (readings, fields of `Frame`)."""
        rows = [reading.frame for reading in self.readings]
        return np.array(rows, dtype=np.float64).reshape(-1, len(Frame._fields))

    def trace(self) -> Trace:
        """Return its trace, all in the phase `approach`, because no controller of graspsense is known."""
        phases = [APPROACH] * len(self.readings)
        return trace_of_readings(self.readings, {**SI_UNITS, **self.units}, phases, [0.0] * len(phases))

    def columns(self, *names: str) -> NDArray[np.float64]:
        """Return these fields of its frames: shape (fields, readings)."""
        return self.frames[:, [Frame._fields.index(name) for name in names]].T


def trace_of_readings(
    readings: Sequence[Reading], units: Mapping[str, str], phases: Sequence[int], commands: Sequence[float]
) -> Trace:
    """Return the trace of these readings, with the phase and the command of each."""
    images = {reading.pads.counter: reading.pads for reading in readings if reading.pads.counter}
    signals = [reading.signals for reading in readings]
    return trace_of(
        [reading.frame for reading in readings], phases, commands, list(images.values()), units, signals
    )


def check_recording(recording: Recording) -> None:
    """Raise DataDamaged if a recording has nothing to replay, or what no gripper can have measured."""
    if not recording.readings:
        raise DataDamaged(f"{recording.name} has no frames")
    delivered = Delivered(recording.channels)
    for k, reading in enumerate(recording.readings, 1):
        if problem := delivered.problem(reading):
            raise DataDamaged(f"{recording.name}: frame {k}: {problem}")
    if not np.isfinite(recording.columns("t_s")).all():
        raise DataDamaged(f"{recording.name}: the time of a frame is not a number")
    if not 0.0 < recording.rate_hz < math.inf:
        raise DataDamaged(f"{recording.name}: its rate is {recording.rate_hz} frames a unit of time")


def recorded_channels(recording: Recording) -> tuple[Channel, ...]:
    """Return the channels that a recording has: gap, velocity and both forces, and of the others those with a value."""
    own = {channel.name: channel for channel in recording.channels}
    frames = [
        own.pop(name, Channel(name, unit, _rate_hz(recording, name)))
        for name, unit in CHANNELS.items()
        if name in own or _has(recording, name)
    ]
    return (*frames, *own.values())


def _has(recording: Recording, name: str) -> bool:
    """Return whether a recording has a value of this channel of a frame."""
    if name in ALWAYS:
        return True
    if name == "pads":
        return any(reading.pads.counter for reading in recording.readings)
    return not bool(np.isnan(recording.columns(f"{name}_n")).all())


def _rate_hz(recording: Recording, channel: str) -> float:
    """Return the rate at which a recording has this channel of a frame; 0 if its times are not in seconds."""
    if recording.units.get("t", "s") != "s":
        return 0.0
    if channel != "pads":
        return recording.rate_hz
    images = {
        reading.pads.counter: reading.pads.t_s for reading in recording.readings if reading.pads.counter
    }
    seconds = max(images.values()) - min(images.values()) if images else 0.0
    return (len(images) - 1) / seconds if seconds > 0.0 else 0.0


def content_sha256(recording: Recording) -> str:
    """Return a hash of the frames, images and channels: equal for the same grasp under another file name or label."""
    content = hashlib.sha256()
    counter = 0
    seen: dict[int, int] = {}
    for reading in recording.readings:
        content.update(_FRAME.pack(*reading.frame))
        pads = reading.pads
        if pads.counter != counter:
            counter = pads.counter
            content.update(struct.pack(f"<{2 * len(pads.left)}d", *pads.left, *pads.right))
        if reading.signals:
            shown = list(reading.signals)
            for i, value in enumerate(shown):
                if isinstance(value, Image) and dtype_of(value) != FLOATS:
                    # The text of a large array shows some of its cells only.
                    if seen.get(i) != value.counter:
                        content.update(value.cells.tobytes())
                    seen[i], shown[i] = value.counter, value[:2]
            content.update(repr(tuple(shown)).encode())
    return content.hexdigest()


_CURVE: Final = struct.Struct("<5d")
_SHORTEST_PART: Final = 10
"""Different frames that a part must have: before the fingers move, all grasps are alike."""


def curve_bytes(readings: Iterable[Reading]) -> bytes:
    """Return the curves of a grasp without its times, as bytes that are equal for equal curves."""
    frames = (reading.frame for reading in readings)
    return b"".join(
        _CURVE.pack(frame.gap_m, frame.velocity_m_s, frame.effort_n, frame.force_left_n, frame.force_right_n)
        for frame in frames
    )


def grasp_numbers(curves: Sequence[bytes]) -> list[int]:
    """Return a number for each of these curves (`curve_bytes`), equal for those of the same grasp.

    It is the place of the longest curve of the grasp.
    """
    numbers = list(range(len(curves)))
    longest: dict[bytes, list[int]] = {}
    for i in sorted(numbers, key=lambda i: -len(curves[i])):
        curve = curves[i]
        alike = longest.setdefault(curve[: _CURVE.size], [])
        whole = next((k for k in alike if curves[k].startswith(curve)), None)
        if whole is not None and (len(curves[whole]) == len(curve) or _is_part(curve)):
            numbers[i] = whole
        else:
            alike.append(i)
    return numbers


def _is_part(curve: bytes) -> bool:
    return len({curve[k : k + _CURVE.size] for k in range(0, len(curve), _CURVE.size)}) >= _SHORTEST_PART
