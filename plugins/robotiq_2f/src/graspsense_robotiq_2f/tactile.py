"""TSF-85 fingertips: read in a thread of their own, with their own clock beside that of the host."""

from __future__ import annotations

import time
from contextlib import suppress
from math import nan
from typing import Any, Final, NamedTuple, final

from graspsense.gripper_api import DeviceClock, ReadingThread
from graspsense.plugin_api import FastChannel, Samples
from graspsense_robotiq_2f.tactile_protocol import (
    ACCELERATION,
    DYNAMIC,
    GYROSCOPE,
    PRESSURE,
    START_SENDING,
    STOP_SENDING,
    TIMESTAMP,
    Packets,
    decoded,
)

BAUD: Final = 115200
READ_S: Final = 0.1
"""Longest wait of one read, so that the thread can end."""
TICKS_S: Final = 1e6
"""Ticks of the fingertips' clock in a second: an assumption, which their description does not give."""
RATE_HZ: Final = 1000.0
MOST: Final = 30
"""Samples of each channel that a frame can hold: those of three frames."""
_AXES: Final = ("x", "y", "z")
_KINDS: Final = {
    DYNAMIC: ("dynamic", ("value",)),
    ACCELERATION: ("acceleration", _AXES),
    GYROSCOPE: ("rotation", _AXES),
}
CHANNELS: Final = tuple(
    FastChannel(f"{name}_{side}", "counts", RATE_HZ, samples=MOST, axes=axes, clock="sensor")
    for name, axes in _KINDS.values()
    for side in ("left", "right")
)
"""Change of pressure, acceleration and rate of turn of each fingertip, raw: no document gives a scale."""

Row = tuple[float, ...]


class TactileImage(NamedTuple):
    """The last image of both fingertips, and the host's time (s) at which it was measured at the latest."""

    host_s: float
    counter: int
    left: Row
    right: Row


class TactileData(NamedTuple):
    """What came since the last time: the newest image, if any, and the samples of each channel, oldest first.

    `taken` is the number of packets with measurements so far, `host_s` when the last one was measured.
    """

    image: TactileImage | None
    rows: tuple[tuple[Row, ...], ...]
    taken: int
    host_s: float

    def nothing_new(self) -> TactileData:
        """Return the same without samples and image."""
        return self._replace(image=None, rows=((),) * len(CHANNELS))

    def signals(self, began_s: float) -> tuple[Samples, ...]:
        """Return the samples of `CHANNELS`, at times since the grasp began."""
        made = []
        for channel, rows in zip(CHANNELS, self.rows, strict=True):
            new = rows[-MOST:]
            fill = ((nan,) * len(channel.axes),) * (MOST - len(new))
            made.append(Samples(self.host_s - began_s, self.taken, len(new), (*new, *fill)))
        return tuple(made)


def joined(before: TactileData, now: TactileData) -> TactileData:
    """Return the data of both."""
    rows = tuple((*first, *second)[-MOST:] for first, second in zip(before.rows, now.rows, strict=True))
    return TactileData(now.image or before.image, rows, now.taken, now.host_s)


@final
class TactileStream:
    """Understands the bytes of both fingertips, in the order in which they come."""

    def __init__(self) -> None:
        self.clock = DeviceClock()
        self.damaged = 0
        """The number of packets that could not be understood."""
        self._packets = Packets()
        self._cells: dict[int, Row] = {}
        self._images = self._taken = 0

    def fed(self, data: bytes, arrived_s: float) -> TactileData | None:
        """Return what these bytes, which arrived at this time of the host, complete; None if nothing."""
        host_s, pressed, taken = arrived_s, False, self._taken
        rows: dict[tuple[int, int], list[Row]] = {(kind, finger): [] for kind in _KINDS for finger in (0, 1)}
        for _, given in self._packets.fed(data):
            fields = decoded(given)
            if fields is None:
                self.damaged += 1
                continue
            self._taken += any(field.kind == DYNAMIC for field in fields)
            for kind, finger, values in fields:
                if kind == TIMESTAMP and finger == 0:
                    host_s = arrived_s - self.clock.age_s(values[0] / TICKS_S, arrived_s)
                elif kind == PRESSURE:
                    self._cells[finger] = tuple(map(float, values))
                    pressed = True
                elif kind in _KINDS and finger < 2:
                    rows[kind, finger].append(tuple(map(float, values)))
        image = None
        if pressed and len(self._cells) == 2:
            self._images += 1
            image = TactileImage(host_s, self._images, self._cells[0], self._cells[1])
        if image is None and self._taken == taken:
            return None
        return TactileData(image, tuple(map(tuple, rows.values())), self._taken, host_s)


@final
class TactileFingertips:
    """Fingertips at a serial port, which send by themselves from construction to `close`. Raises OSError."""

    def __init__(self, port: str) -> None:
        import serial

        self.stream = TactileStream()
        self._port: Any = serial.Serial(port, BAUD, timeout=READ_S, write_timeout=READ_S, exclusive=True)
        self._port.write(START_SENDING)
        self._thread = ReadingThread(self._read, name="TSF-85", joined=joined)

    def newest(self, timeout_s: float) -> TactileData | None:
        """Return what came since the last call, None if nothing comes in time. Raises OSError."""
        return self._thread.newest(timeout_s)

    def age_s(self) -> float:
        """Return the time (s) since something came."""
        return self._thread.age_s()

    def close(self) -> None:
        """Stop their sending, and close the port."""
        self._thread.close()
        with suppress(OSError):
            self._port.write(STOP_SENDING)
        with suppress(OSError):
            self._port.close()

    def _read(self) -> TactileData | None:
        data = self._port.read(self._port.in_waiting or 1)
        return self.stream.fed(data, time.monotonic())
