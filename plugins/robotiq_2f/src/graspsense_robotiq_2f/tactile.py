"""TSF-85 fingertips: read in a thread of their own, with their own clock beside that of the host."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack, closing, suppress
from math import inf, nan
from typing import Any, Final, NamedTuple, Protocol, final

from graspsense.gripper_api import DeviceClock, ReadingThread, clock_report, why_not_opened
from graspsense.plugin_api import FastChannel, Samples
from graspsense_robotiq_2f.tactile_protocol import (
    ACCELERATION,
    DYNAMIC,
    FINGERS,
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
LEAST_S: Final = 1e-6
"""Least time between two images."""
SIDES: Final = ("left", "right")
_AXES: Final = ("x", "y", "z")
_KINDS: Final = {
    DYNAMIC: ("dynamic", ("value",)),
    ACCELERATION: ("acceleration", _AXES),
    GYROSCOPE: ("rotation", _AXES),
}
CHANNELS: Final = tuple(
    FastChannel(f"{name}_{side}", "counts", RATE_HZ, samples=MOST, axes=axes, clock="sensor")
    for name, axes in _KINDS.values()
    for side in SIDES
)
"""Change of pressure, acceleration and rate of turn of each fingertip, raw: no document gives a scale."""

Row = tuple[float, ...]


class TactileImage(NamedTuple):
    """The last image of each fingertip, and the host's time (s) at which the oldest was measured at the latest."""

    host_s: float
    counter: int
    cells: tuple[Row, ...]


class TactileData(NamedTuple):
    """What came from a board since the last time: the newest image, if any, and each channel's samples, oldest first.

    `taken` is the number of packets with measurements so far, `host_s` when the last one was measured.
    """

    image: TactileImage | None
    rows: tuple[tuple[Row, ...], ...]
    taken: int
    host_s: float

    def nothing_new(self) -> TactileData:
        """Return the same without samples and image."""
        return self._replace(image=None, rows=((),) * len(self.rows))

    def signals(self, began_s: float) -> tuple[Samples, ...]:
        """Return the samples of the board's fingertips in the order of `CHANNELS`, at times since the grasp began."""
        made = []
        for channel, rows in zip(CHANNELS[:: len(CHANNELS) // len(self.rows)], self.rows, strict=True):
            new = rows[-MOST:]
            fill = ((nan,) * len(channel.axes),) * (MOST - len(new))
            made.append(Samples(self.host_s - began_s, self.taken, len(new), (*new, *fill)))
        return tuple(made)


def joined(earlier: TactileData, now: TactileData) -> TactileData:
    """Return the data of both."""
    rows = tuple((*old, *new)[-MOST:] for old, new in zip(earlier.rows, now.rows, strict=True))
    return TactileData(now.image or earlier.image, rows, now.taken, now.host_s)


@final
class TactileStream:
    """Understands the bytes of a board with this many fingertips, in the order in which they come."""

    def __init__(self, fingers: int = FINGERS) -> None:
        self._fingers = fingers
        # No document tells which number the only fingertip of a board has: that which comes first.
        self._lowest = 0 if fingers == FINGERS else None
        self.clock = DeviceClock()
        self.damaged = 0
        """The number of packets that could not be understood."""
        self._packets = Packets()
        self._cells: dict[int, Row] = {}
        self._images = self._taken = 0

    def fed(self, data: bytes, arrived_s: float) -> TactileData | None:
        """Return what these bytes, which arrived at this time of the host, complete; None if nothing."""
        host_s, pressed, taken = arrived_s, False, self._taken
        rows: dict[tuple[int, int], list[Row]] = {
            (kind, finger): [] for kind in _KINDS for finger in range(self._fingers)
        }
        for _, given in self._packets.fed(data):
            fields = decoded(given)
            if fields is None:
                self.damaged += 1
                continue
            for kind, number, values in fields:
                if self._lowest is None:
                    self._lowest = number
                finger = number - self._lowest
                if not 0 <= finger < self._fingers:
                    continue
                if kind == TIMESTAMP and finger == 0:
                    host_s = arrived_s - self.clock.age_s(values[0] / TICKS_S, arrived_s)
                elif kind == PRESSURE:
                    self._cells[finger] = tuple(map(float, values))
                    pressed = True
                elif kind in _KINDS:
                    rows[kind, finger].append(tuple(map(float, values)))
        self._taken += max(len(rows[DYNAMIC, finger]) for finger in range(self._fingers))
        image = None
        if pressed and len(self._cells) == self._fingers:
            self._images += 1
            image = TactileImage(
                host_s, self._images, tuple(self._cells[finger] for finger in range(self._fingers))
            )
        if image is None and self._taken == taken:
            return None
        return TactileData(image, tuple(map(tuple, rows.values())), self._taken, host_s)


class Board(Protocol):
    """A board with one fingertip or both, which sends by itself."""

    stream: TactileStream

    def newest(self, timeout_s: float) -> TactileData | None:
        """Return what came since the last call, None if nothing comes in time. Raises OSError."""

    def age_s(self) -> float:
        """Return the time (s) since something came."""

    def close(self) -> None:
        """Release it."""


@final
class TactileFingertips:
    """The fingertips of a gripper: one board with both, or two with one each, of which the left one is first."""

    def __init__(self, boards: Sequence[Board]) -> None:
        self.image: TactileImage | None = None
        """What the last `take` completed: with two boards, there is an image with each of the left one."""
        self._boards = boards
        nothing = TactileData(None, ((),) * (len(CHANNELS) // len(boards)), 0, 0.0)
        self._data = [nothing for _ in boards]
        self._images: dict[int, TactileImage] = {}
        self._image_s = -inf
        self._apart_s = 0.0

    def take(self, timeout_s: float) -> bool:
        """Take what came since the last call. Return whether each board sent something in time. Raises OSError."""
        came = [board.newest(timeout_s) for board in self._boards]
        self._data = [data or last.nothing_new() for data, last in zip(came, self._data, strict=True)]
        self._images |= {i: data.image for i, data in enumerate(self._data) if data.image is not None}
        whole = self._data[0].image is not None and len(self._images) == len(self._boards)
        self.image = self._joined_image() if whole else None
        return None not in came

    def signals(self, began_s: float) -> tuple[Samples, ...]:
        """Return the samples of `CHANNELS` that the last `take` brought, at times since the grasp began."""
        boards = [data.signals(began_s) for data in self._data]
        return tuple(samples for same_kind in zip(*boards, strict=True) for samples in same_kind)

    def age_s(self) -> float:
        """Return the time (s) since something came from the board that is silent for longest."""
        return max(board.age_s() for board in self._boards)

    def report(self) -> dict[str, float | str]:
        """Return the clocks of the boards, and how many of their packets could not be understood."""
        clocks = [board.stream.clock for board in self._boards]
        damaged = {"tactile_damaged": sum(board.stream.damaged for board in self._boards)}
        if len(clocks) == 1:
            return {**clock_report("tactile", clocks[0], ("pads", *_channels(*SIDES))), **damaged}
        reports = [
            clock_report(f"tactile_{side}", clock, _channels(side))
            for side, clock in zip(SIDES, clocks, strict=True)
        ]
        # An image has the time of the older half, so the other half can be off by their distance.
        uncertain_s = max(clock.line().uncertainty_s for clock in clocks) + self._apart_s
        return {
            **reports[0],
            **reports[1],
            "pads_channels": "pads",
            "pads_uncertainty_s": uncertain_s,
            **damaged,
        }

    def close(self) -> None:
        """Release the boards."""
        for board in self._boards:
            board.close()

    def _joined_image(self) -> TactileImage:
        images = [self._images[i] for i in range(len(self._boards))]
        times = [image.host_s for image in images]
        self._apart_s = max(self._apart_s, max(times) - min(times))
        # The older half can be that of the image before, and what is learnt of a clock can put an image before another.
        self._image_s = max(min(times), self._image_s + LEAST_S)
        cells = tuple(cells for image in images for cells in image.cells)
        return TactileImage(self._image_s, images[0].counter, cells)


def opened_boards(ports: Sequence[str]) -> list[TactileBoard]:
    """Return the boards at these serial ports, all or none. Raises OSError."""
    with ExitStack() as opened:
        boards = [opened.enter_context(closing(TactileBoard(port, FINGERS // len(ports)))) for port in ports]
        opened.pop_all()
    return boards


def _channels(*sides: str) -> list[str]:
    names = ["force_left", "force_right", *(channel.name for channel in CHANNELS)]
    return [name for name in names if name.endswith(sides)]


@final
class TactileBoard:
    """A board with this many fingertips at a serial port, which sends from construction to `close`. Raises OSError."""

    def __init__(self, port: str, fingers: int) -> None:
        import serial

        self.stream = TactileStream(fingers)
        try:
            self._port: Any = serial.Serial(port, BAUD, timeout=READ_S, write_timeout=READ_S, exclusive=True)
        except (OSError, ValueError) as error:
            raise OSError(f"the fingertips at {port}: {why_not_opened(port)}") from error
        self._port.write(START_SENDING)
        self._thread = ReadingThread(self._read, name="TSF-85", joined=joined)

    def newest(self, timeout_s: float) -> TactileData | None:
        """Return what came since the last call, None if nothing comes in time. Raises OSError."""
        return self._thread.newest(timeout_s)

    def age_s(self) -> float:
        """Return the time (s) since something came."""
        return self._thread.age_s()

    def close(self) -> None:
        """Stop its sending, and close the port."""
        self._thread.close()
        with suppress(OSError):
            self._port.write(STOP_SENDING)
        with suppress(OSError):
            self._port.close()

    def _read(self) -> TactileData | None:
        data = self._port.read(self._port.in_waiting or 1)
        return self.stream.fed(data, time.monotonic())
