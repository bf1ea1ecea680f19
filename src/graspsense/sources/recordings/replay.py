"""A recording as a gripper: it returns the recorded frames in order, and ignores all commands."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from importlib import import_module
from math import inf
from typing import Final, final

from attrs import Attribute, frozen
from attrs.validators import and_, instance_of

from graspsense.core.components.entries import KINDS as COMMAND_KINDS
from graspsense.core.components.firstparty import provider
from graspsense.core.components.registry import installed
from graspsense.core.components.roles import SensorBackend
from graspsense.core.components.setting import NAMES_INPUT, setting
from graspsense.core.values.channel import Channel
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import DeviceLost, GraspsenseError, RecordingEnded, suggestion
from graspsense.core.values.signals import CHANNELS, EFFORT, Command, Pads, Reading
from graspsense.recording.readable import readable
from graspsense.recording.replayable import Recording, check_recording, recorded_channels
from graspsense.sources.columns.recording_notices import signal_notices
from graspsense.sources.recordings.dataset_recordings import (
    datasets_with_recordings,
    handed_recording,
    is_recording_number,
    numbered_recording,
)
from graspsense.store.opening import as_source

KINDS: Final = {
    "csv": "graspsense.sources.recordings.grasp_csv:read_csv",
    "icub": "graspsense.sources.recordings.icub:read_recording",
    "mcap": "graspsense.recording.reader:read_recording",
    "npz": "graspsense.sources.recordings.exported_grasp:read_exported",
    "parquet": "graspsense.sources.recordings.exported_grasp:read_exported",
    "rosbag": "graspsense.sources.recordings.rosbag:read_bag",
    "store": "graspsense.store.stored_grasps:stored_recording",
}
"""What can stand before the colon of the name of a recording, and the reader of that kind, imported when it is needed.

The data sets that have recordings can stand there as well, with the number of a recording: `manifest:FILE.toml#3`.
"""


def known_kinds() -> tuple[str, ...]:
    """Return all that can stand before the colon of the name of a recording."""
    return tuple(dict.fromkeys((*KINDS, *datasets_with_recordings())))


def read_named(kind: str, name: str) -> Recording:
    """Return the recording of this kind and name. Raises ConfigError, DataDamaged."""
    handed = handed_recording(f"{kind}:{name}")
    if handed is not None:
        return handed
    if kind in KINDS and not is_recording_number(kind, name):
        module, _, reader = KINDS[kind].partition(":")
        with readable(f"{kind}:{name}"):
            recording: Recording = getattr(import_module(module), reader)(name)
            check_recording(recording)
            return recording
    return numbered_recording(kind, name).recording


def kind_and_name(recording: str) -> tuple[str, str]:
    """Return what stands before and behind the colon; a file that ends in `.mcap` needs no kind."""
    recording = as_source(recording)
    kind, colon, name = recording.partition(":")
    if recording.endswith(".mcap") and kind not in KINDS:
        return "mcap", recording
    return (kind, name) if colon else ("", recording)


def how_to_get(kind: str) -> str:
    """Return lines on how to install or to enable what reads this kind of recording; empty if there is nothing."""
    plugins, by = installed(), provider("data set", kind)
    if by and by.distribution not in {status.distribution for status in plugins.statuses}:
        return f"\n  {kind}: is read by {by.distribution}, which is not installed:\n  {by.hint}"
    return plugins.absences()


def _known_kind(_config: object, _attribute: Attribute[str], value: str) -> None:
    kind, name = kind_and_name(value)
    kinds = tuple(KINDS) if kind in KINDS else known_kinds()
    known = ", ".join(f"{k}:" for k in kinds)
    if not kind:
        raise ValueError(
            f"{value!r} does not say what kind of recording it is: write {known} before the file; a trial of "
            "a store is DIR#NUMBER"
        )
    if kind not in kinds:
        raise ValueError(
            f"unknown kind of recording {kind!r}. Known: {known}.{suggestion(kind, kinds)}{how_to_get(kind)}"
        )
    if not name:
        raise ValueError(f"{value!r} names no file: write it after the colon")


@frozen
class ReplayConfig:
    """Which recording is replayed."""

    recording: str = setting(
        validator=and_(instance_of(str), _known_kind),
        effect=NAMES_INPUT,
        meaning="The recording, KIND:FILE, as in icub:FOLDER/full_vitamin_water_1.txt. store:DIR#NUMBER is a trial of "
        "a store, manifest:FILE.toml#NUMBER a grasp of a manifest. A FILE.mcap needs no kind.",
    )


@final
class ReplayBackend(SensorBackend[ReplayConfig]):
    """Gives the frames of a recording, one a read; commands have no effect on what has happened."""

    accepts = COMMAND_KINDS

    _kept: Recording | None = None
    _is_open = False
    _next = 0

    @property
    def channels(self) -> tuple[Channel, ...]:
        """The channels that the recording has, which is read for this; those of a frame if it cannot be read."""
        with suppress(GraspsenseError):  # `open` reports it
            return recorded_channels(self._read())
        return tuple(Channel(name, unit) for name, unit in CHANNELS.items())

    def open(self, seed: int) -> DeviceInfo:
        """Read the recording and describe it; the seed has no effect.

        Raises ConfigError if there is no such file, DataDamaged if it is not what it claims to be.
        """
        recording = self._read()
        self._is_open, self._next = True, 0
        return DeviceInfo(
            name=recording.name,
            clock="virtual",
            harmless=True,
            rate_hz=recording.rate_hz,
            effort_limit_n=inf,
            speed_limit_m_s=inf,
            opening=None,
            relaxed=Command(EFFORT, 0.0, inf, inf),
            has_release=recording.has_release,
            units=recording.units,
            mounting=recording.mounting,
            notes=tuple(dict.fromkeys((*recording.notes, *recording.notices, *signal_notices(recording)))),
            recorded_with=recording.recorded_with,
        )

    def read(self, timeout_s: float) -> Reading:
        """Return the next frame at once. Raises RecordingEnded after the last, DeviceLost when not open."""
        readings = self._opened().readings
        if self._next == len(readings):
            raise RecordingEnded
        self._next += 1
        return readings[self._next - 1]

    def apply(self, command: Command) -> None:
        """Do nothing: a recording cannot be commanded. Raises DeviceLost when not open."""
        self._opened()

    def tare(self, images: Sequence[Pads]) -> None:
        """Do nothing: the reader of the recording has set its zero. Raises DeviceLost when not open."""
        self._opened()

    def close(self) -> None:
        """Let go of the recording."""
        self._is_open = False

    def recorded_commands(self) -> Sequence[float] | None:
        """Return the commands of the recording, None where it does not hold them."""
        return None if self._kept is None else self._kept.commands

    def report(self) -> Mapping[str, float | int | str | bool]:
        """Return which recording this is and how many of its frames were read."""
        return {"recording": self.config.recording, "frames_read": self._next}

    def _read(self) -> Recording:
        """Return the recording in the settings, read once."""
        if self._kept is None:
            kind, name = kind_and_name(self.config.recording)
            self._kept = read_named(kind, name)
        return self._kept

    def _opened(self) -> Recording:
        if not self._is_open:
            raise DeviceLost("the recording is not open")
        return self._read()
