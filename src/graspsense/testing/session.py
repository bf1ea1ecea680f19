"""The readings of a gripper while it is opened, closed gently, and opened again; recorded once for all checks."""

from __future__ import annotations

import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from math import ceil
from typing import Any, Final
from zlib import crc32

from attrs import define, field

from graspsense.core.components.channels import dtype_of
from graspsense.core.components.entries import KINDS
from graspsense.core.components.roles import SensorBackend
from graspsense.core.control.contact import CONTACT_FORCE_N
from graspsense.core.control.garbage_collection import no_collection
from graspsense.core.control.guard import GuardParams, GuardState, guard
from graspsense.core.values.channel import FLOATS
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import GraspsenseError, RecordingEnded, named
from graspsense.core.values.signals import FORCE, Command, Frame, Image, Pads, Reading
from graspsense.testing.checks import CheckFailed
from graspsense.testing.laws import EFFORT_N, closing, kind_of

TIMEOUT_S: Final = 0.1
OPENING_S: Final = 1.0
CLOSING_S: Final = 2.5
FIRST_SPEED_M_S: Final = 0.015
RECORDED_FRAMES: Final = 2000


@define
class Session:
    """The readings by stage: `opening`, `closing`, `open again`; or `recording` for a recording."""

    info: DeviceInfo
    opened_s: float = 0.0
    """The time (s) that `open` took."""
    stages: dict[str, list[Reading]] = field(factory=dict)
    sums: list[tuple[int, ...]] = field(factory=list)
    """The checksums of the images of each reading when it came, of those that are numpy arrays."""
    closed_s: float = 0.0
    longest_read_s: float = 0.0
    silent: int = 0

    @property
    def readings(self) -> list[Reading]:
        """Return all readings, in order."""
        return [reading for stage in self.stages.values() for reading in stage]

    @property
    def frames(self) -> list[Frame]:
        """Return the frames, in order."""
        return [reading.frame for reading in self.readings]

    @property
    def images(self) -> list[Pads]:
        """Return the cell images, each once, in order."""
        images: list[Pads] = []
        for _, pads, _ in self.readings:
            if pads.counter and (not images or images[-1].counter != pads.counter):
                images.append(pads)
        return images


def description(info: Any) -> DeviceInfo:
    """Return what `open` returned. Raises CheckFailed if that is no DeviceInfo."""
    if not isinstance(info, DeviceInfo):
        raise CheckFailed(f"open returned {info!r}: return graspsense.plugin_api.DeviceInfo")
    return info


def next_reading(backend: SensorBackend[Any]) -> Reading | None:
    """Return the next reading, None if none came in time. Raises CheckFailed for what is no reading."""
    reading = backend.read(TIMEOUT_S)
    if reading is not None and not (
        isinstance(reading, Reading) and isinstance(reading.frame, Frame) and isinstance(reading.pads, Pads)
    ):
        raise CheckFailed(
            f"read returned {reading!r:.80}: return Reading(Frame(...), Pads(...), signals), with NO_PADS where "
            "there are no cells and () where there are no further channels",
            "read returned no Reading",
        )
    return reading


@contextmanager
def opened(subject: Any, seed: int = 0, **keys: Any) -> Iterator[tuple[Any, Session]]:
    """Open the gripper under check within this context, with these settings as well, for a session without readings."""
    backend = subject.create(**keys)
    try:
        yield backend, Session(description(backend.open(seed)))
    finally:
        backend.close()


def readings_of(subject: Any, kind: int | None = None) -> Session:
    """Open the gripper under check, use it for some seconds of its own clock, close it, and return the readings.

    The fingers close by commands of this kind, by default the first one that it accepts.
    """
    backend = subject.create()
    try:
        began = time.perf_counter()
        info = description(backend.open(0))
        session = Session(info, opened_s=time.perf_counter() - began)
        with suppress(RecordingEnded), no_collection():
            if info.opening is None:
                use(session, backend, "recording", RECORDED_FRAMES, None)
            else:
                kind = kind_of(subject.entry.accepts) if kind is None else kind
                use(session, backend, "opening", ticks_in(info, OPENING_S), info.opening)
                use(session, backend, "closing", ticks_in(info, CLOSING_S), kind)
                use(session, backend, "open again", ticks_in(info, OPENING_S), info.opening)
                backend.apply(info.relaxed)
    except GraspsenseError as error:
        raise CheckFailed(
            f"it cannot be used as it is set: {error}\n    give it the settings to be checked with (-o KEY=VALUE, or "
            "`keys` in a test)",
            str(error),
        ) from error
    finally:
        began = time.perf_counter()
        backend.close()
        closed_s = time.perf_counter() - began
    session.closed_s = closed_s
    if not session.frames:
        raise CheckFailed(f"no frame came within {TIMEOUT_S} s, {session.silent} times: is its rate correct?")
    return session


def sums_of(reading: Reading) -> tuple[int, ...]:
    """Return a checksum of each image of a reading that is a numpy array."""
    images = [value for value in getattr(reading, "signals", ()) if isinstance(value, Image)]
    return tuple(crc32(image.cells.tobytes()) for image in images if dtype_of(image) != FLOATS)


def limits_of(info: DeviceInfo) -> GuardParams:
    """Return the limits for the first use of a gripper."""
    return GuardParams(
        effort_limit_n=info.effort_limit_n,
        speed_limit_m_s=info.speed_limit_m_s,
        first_effort_n=EFFORT_N,
        first_speed_m_s=FIRST_SPEED_M_S,
        contact_force_n=CONTACT_FORCE_N,
    )


def ticks_in(info: DeviceInfo, seconds: float) -> int:
    """Return the number of ticks of this gripper in so many seconds, 20 at least."""
    return max(ceil(seconds * info.rate_hz), 20)


def use(
    session: Session,
    backend: SensorBackend[Any],
    stage: str,
    ticks: int,
    command: Command | int | None,
    limits: GuardParams | None = None,
) -> None:
    """Read `ticks` times, and apply after each the given command, or one of the given kind that closes, as limited."""
    readings = session.stages.setdefault(stage, [])
    watcher, limits = GuardState(0, 0, 0), limits or limits_of(session.info)
    for _ in range(ticks):
        began = time.perf_counter()
        reading = next_reading(backend)
        session.longest_read_s = max(session.longest_read_s, time.perf_counter() - began)
        if reading is None:
            session.silent += 1
            if session.silent > 10:
                return
            continue
        readings.append(reading)
        session.sums.append(sums_of(reading))
        if command is None:
            continue
        frame = reading.frame
        asked = command
        if isinstance(asked, int):
            earlier = readings[max(len(readings) - 2, 0)].frame
            asked = closing(asked, frame.t_s - readings[0].frame.t_s, earlier.gap_m, frame)
            if asked.kind == FORCE:
                asked = asked._replace(value=max(asked.value, backend.least_force_n))
        allowed, watcher = guard(limits, watcher, frame, asked)
        try:
            backend.apply(allowed)
        except GraspsenseError:
            raise
        except Exception as error:
            kind = KINDS[allowed.kind]
            raise CheckFailed(
                f"apply raised {named(error)} on a {kind} command, which `accepts` says it takes: take it, or take "
                f"{kind!r} out of `accepts`"
            ) from error
