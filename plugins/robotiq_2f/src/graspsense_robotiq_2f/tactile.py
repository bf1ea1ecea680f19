"""TSF-85 fingertips: read in a thread of their own, with their own clock beside that of the host."""

from __future__ import annotations

import time
from contextlib import suppress
from typing import Any, Final, NamedTuple, final

from graspsense.gripper_api import DeviceClock, ReadingThread
from graspsense_robotiq_2f.tactile_protocol import AUTOSEND, PRESSURE, TIMESTAMP, Packets, decoded, packet

BAUD: Final = 115200
PERIOD_MS: Final = 1
READ_S: Final = 0.1
"""Longest wait of one read, so that the thread can end."""
TICKS_S: Final = 1e6
"""Ticks of the fingertips' clock in a second: an assumption, which their description does not give."""


class TactileImage(NamedTuple):
    """The last image of both fingertips, and the host's time (s) at which it was measured at the latest."""

    host_s: float
    counter: int
    left: tuple[float, ...]
    right: tuple[float, ...]


@final
class TactileFingertips:
    """TactileFingertips at a serial port, which send by themselves from construction to `close`. Raises OSError."""

    def __init__(self, port: str) -> None:
        import serial

        self.clock = DeviceClock()
        self.damaged = 0
        """The number of packets that could not be understood."""
        self._packets = Packets()
        self._cells: dict[int, tuple[float, ...]] = {}
        self._counter = 0
        self._port: Any = serial.Serial(port, BAUD, timeout=READ_S, write_timeout=READ_S, exclusive=True)
        self._port.write(packet(AUTOSEND[0], bytes((PERIOD_MS,))))
        self._thread = ReadingThread(self._read, name="TSF-85")

    def newest(self, timeout_s: float) -> TactileImage | None:
        """Return the newest image that was not returned yet, None if none comes in time. Raises OSError."""
        return self._thread.newest(timeout_s)

    def age_s(self) -> float:
        """Return the time (s) since the last image."""
        return self._thread.age_s()

    def close(self) -> None:
        """Stop their sending, and close the port."""
        self._thread.close()
        with suppress(OSError):
            self._port.write(packet(AUTOSEND[0], bytes((0,))))
        with suppress(OSError):
            self._port.close()

    def _read(self) -> TactileImage | None:
        data = self._port.read(self._port.in_waiting or 1)
        arrived_s = host_s = time.monotonic()
        pressed = False
        for _, given in self._packets.fed(data):
            fields = decoded(given)
            if fields is None:
                self.damaged += 1
                continue
            for kind, finger, values in fields:
                if kind == TIMESTAMP and finger == 0:
                    host_s = arrived_s - self.clock.age_s(values[0] / TICKS_S, arrived_s)
                elif kind == PRESSURE:
                    self._cells[finger] = tuple(map(float, values))
                    pressed = True
        if not pressed or len(self._cells) < 2:
            return None
        self._counter += 1
        return TactileImage(host_s, self._counter, self._cells[0], self._cells[1])
