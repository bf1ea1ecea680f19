"""TSF-85 fingertips: read in a thread of their own, with their own clock beside that of the host."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import suppress
from math import inf
from typing import Any, Final, NamedTuple, final

from graspsense.gripper_api import DeviceClock, ReadingThread, clock_report
from graspsense_robotiq_2f.tactile_protocol import AUTOSEND, PRESSURE, TIMESTAMP, Packets, decoded, packet

SIDES: Final = ("force_left", "force_right")
BAUD: Final = 115200
PERIOD_MS: Final = 1
READ_S: Final = 0.1
"""Longest wait of one read, so that the thread can end."""
LEAST_S: Final = 1e-6
"""Least time between two images."""
TICKS_S: Final = 1e6
"""Ticks of the fingertips' clock in a second: an assumption, which their description does not give."""


class BoardImage(NamedTuple):
    """The last image of a board's fingertips, and the host's time (s) at which it was measured at the latest."""

    host_s: float
    cells: tuple[tuple[float, ...], ...]


class TactileImage(NamedTuple):
    """The last image of both fingertips, and the host's time (s) of the older one."""

    host_s: float
    counter: int
    left: tuple[float, ...]
    right: tuple[float, ...]


@final
class TactileFingertips:
    """The fingertips of a gripper at serial ports: one board with both, or a board each for left and right.

    They send by themselves from construction to `close`. Raises OSError.
    """

    def __init__(self, ports: Sequence[str]) -> None:
        self._boards: list[TactileBoard] = []
        self._last: list[BoardImage | None] = [None] * len(ports)
        self._counter = 0
        self._apart_s = 0.0
        self._image_s = -inf
        try:
            for port in ports:
                self._boards.append(TactileBoard(port, len(SIDES) // len(ports)))
        except OSError:
            self.close()
            raise

    def newest(self, timeout_s: float) -> TactileImage | None:
        """Return the newest image that was not returned yet, None if none comes in time. Raises OSError.

        With two boards there is a new one with each image of the left board.
        """
        fresh = False
        for i, board in enumerate(self._boards):
            image = board.newest(timeout_s if self._last[i] is None or i == 0 else 0.0)
            if image is not None:
                fresh, self._last[i] = fresh or i == 0, image
        last = [image for image in self._last if image is not None]
        if not fresh or len(last) < len(self._boards):
            return None
        times = [image.host_s for image in last]
        self._apart_s = max(self._apart_s, max(times) - min(times))
        self._counter += 1
        # What is learnt of a clock can put an image before the one that came before it.
        self._image_s = max(min(times), self._image_s + LEAST_S)
        left, right = (cells for image in last for cells in image.cells)
        return TactileImage(self._image_s, self._counter, left, right)

    def age_s(self) -> float:
        """Return the time (s) since the last image of the board that is silent for longest."""
        return max(board.age_s() for board in self._boards)

    def report(self) -> dict[str, float | str]:
        """Return the clocks of the boards, and how many of their packets could not be understood."""
        damaged = {"tactile_damaged": sum(board.damaged for board in self._boards)}
        clocks = [board.clock for board in self._boards]
        if len(clocks) == 1:
            return {**damaged, **clock_report("tactile", clocks[0], ("pads", *SIDES))}
        uncertain_s = max(clock.line().uncertainty_s for clock in clocks)
        return {
            **damaged,
            **clock_report("tactile_left", clocks[0], SIDES[:1]),
            **clock_report("tactile_right", clocks[1], SIDES[1:]),
            "pads_channels": "pads",
            "pads_uncertainty_s": uncertain_s + self._apart_s,
        }

    def close(self) -> None:
        """Stop their sending, and close the ports."""
        for board in self._boards:
            board.close()


@final
class TactileBoard:
    """A board with this many fingertips at a serial port. Raises OSError."""

    def __init__(self, port: str, fingers: int) -> None:
        import serial

        self.clock = DeviceClock()
        self.damaged = 0
        """The number of packets that could not be understood."""
        self._packets = Packets()
        self._cells: dict[int, tuple[float, ...]] = {}
        self._fingers = fingers
        self._port: Any = serial.Serial(port, BAUD, timeout=READ_S, write_timeout=READ_S, exclusive=True)
        self._port.write(packet(AUTOSEND[0], bytes((PERIOD_MS,))))
        self._thread = ReadingThread(self._read, name="TSF-85")

    def newest(self, timeout_s: float) -> BoardImage | None:
        """Return the newest image that was not returned yet, None if none comes in time. Raises OSError."""
        return self._thread.newest(timeout_s)

    def age_s(self) -> float:
        """Return the time (s) since the last image."""
        return self._thread.age_s()

    def close(self) -> None:
        """Stop its sending, and close the port."""
        self._thread.close()
        with suppress(OSError):
            self._port.write(packet(AUTOSEND[0], bytes((0,))))
        with suppress(OSError):
            self._port.close()

    def _read(self) -> BoardImage | None:
        data = self._port.read(self._port.in_waiting or 1)
        arrived_s = host_s = time.monotonic()
        pressed = False
        for _, given in self._packets.fed(data):
            fields = decoded(given)
            if fields is None:
                self.damaged += 1
                continue
            for kind, finger, values in fields:
                if kind == TIMESTAMP and finger == min(self._cells, default=finger):
                    host_s = arrived_s - self.clock.age_s(values[0] / TICKS_S, arrived_s)
                elif kind == PRESSURE:
                    self._cells[finger] = tuple(map(float, values))
                    pressed = True
        if not pressed or len(self._cells) < self._fingers:
            return None
        return BoardImage(
            host_s, tuple(self._cells[finger] for finger in sorted(self._cells)[: self._fingers])
        )
