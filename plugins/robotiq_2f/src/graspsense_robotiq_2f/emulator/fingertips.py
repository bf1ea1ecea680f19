"""TSF-85 fingertips in software: they send what the pads of a hand feel, by themselves or when they are asked."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from random import Random
from typing import Final

from graspsense_robotiq_2f.tactile_protocol import (
    ACCELERATION,
    AUTOSEND,
    CELLS,
    COLUMNS,
    DYNAMIC,
    FINGERS,
    GYROSCOPE,
    PRESSURE,
    READ,
    ROWS,
    TIMESTAMP,
    VERSION,
    Field,
    Packets,
    encoded,
    packet,
)

PRESSURE_S: Final = 1.0 / 60.0
COUNTS_PER_N: Final = 1000.0
"""Counts of all cells under one newton: an assumption, as is the shape of the pressure."""
REST_COUNTS: Final = (150, 250)
"""Counts of cells that nothing touches: each has its own between these."""
NOISE_COUNTS: Final = 3.0
"""Standard deviation of a cell: an assumption. One that never changes is stuck, and the protection ends the grasp."""
G_COUNTS: Final = 16384
MOST_AT_ONCE: Final = 50
"""Packets that are made up for at once, if the machine was busy."""
# The thing does not reach the ends of the pad: what raises all cells alike is drift (core/grasp/protection/drift.py).
_SHAPE: Final = [
    (1.0 - abs(row - 3) / 3.0) * (1.0 - abs(column - 1.5) / 2.0)
    for row in range(ROWS)
    for column in range(COLUMNS)
]
_TOTAL: Final = sum(_SHAPE)


class EmulatedFingertips:
    """A board with these fingertips; `felt` returns the forces (N) on the left and the right one.

    `heard` and `unasked` are the sides of a port.
    """

    def __init__(
        self,
        felt: Callable[[], tuple[float, float]],
        monotonic: Callable[[], float] | None = None,
        seed: int = 0,
        fingers: Sequence[int] = range(FINGERS),
    ) -> None:
        self.fingers = fingers
        """Which of the gripper's fingers it has; they are counted from 0 in its packets."""
        self._random = Random(seed)
        self.rest = tuple(
            tuple(self._random.randint(*REST_COUNTS) for _ in range(CELLS)) for _ in range(FINGERS)
        )
        """The counts of each cell of each finger that nothing touches."""
        self._felt, self._monotonic = felt, monotonic or time.monotonic
        self._packets = Packets()
        self._began_s = self._monotonic()
        self._period_s = self._due_s = self._pressed_s = 0.0
        self._last = (0.0, 0.0)

    def heard(self, data: bytes) -> bytes:
        """Return the replies to what a host sent."""
        return b"".join(self._reply(command, given) for command, given in self._packets.fed(data))

    def unasked(self) -> bytes:
        """Return the packets that are due, with one of each period, none twice."""
        if not self._period_s:
            return b""
        now_s = self._monotonic() - self._began_s
        packets: list[bytes] = []
        while self._due_s <= now_s and len(packets) < MOST_AT_ONCE:
            packets.append(self._measured(self._due_s))
            self._due_s += self._period_s
        return b"".join(packets)

    def _reply(self, command: int, given: bytes) -> bytes:
        now_s = self._monotonic() - self._began_s
        if command in AUTOSEND and given:
            self._period_s, self._due_s = given[0] / 1000.0, now_s
        elif command == READ:
            return self._measured(now_s)
        elif command == VERSION:
            return packet(VERSION, b"graspsense emulated")
        return b""

    def _measured(self, now_s: float) -> bytes:
        pressed = now_s >= self._pressed_s
        earlier = self._last
        if pressed:
            self._pressed_s = now_s + PRESSURE_S
            self._last = self._felt()
        fields = []
        for number, finger in enumerate(self.fingers):
            force_n, before_n = self._last[finger], earlier[finger]
            fields.append(Field(TIMESTAMP, number, (round(now_s * 1e6),)))
            if pressed:
                fields.append(Field(PRESSURE, number, self._cells(finger, force_n)))
            change = round(min(max((force_n - before_n) * COUNTS_PER_N, -32768.0), 32767.0))
            fields.append(Field(DYNAMIC, number, (change,)))
            fields.append(Field(ACCELERATION, number, (0, 0, G_COUNTS)))
            fields.append(Field(GYROSCOPE, number, (0, 0, 0)))
        return encoded(fields)

    def _cells(self, finger: int, force_n: float) -> tuple[int, ...]:
        counts = max(force_n, 0.0) * COUNTS_PER_N / _TOTAL
        return tuple(
            min(max(round(zero + counts * share + self._random.gauss(0.0, NOISE_COUNTS)), 0), 0xFFFF)
            for zero, share in zip(self.rest[finger], _SHAPE, strict=True)
        )


def emulated_boards(
    count: int,
    felt: Callable[[], tuple[float, float]],
    monotonic: Callable[[], float] | None = None,
    seed: int = 0,
) -> list[EmulatedFingertips]:
    """Return this many boards: one with both fingertips, or two with one each, the left one first."""
    split = [range(FINGERS)] if count == 1 else [range(finger, finger + 1) for finger in range(count)]
    return [EmulatedFingertips(felt, monotonic, seed + fingers.start, fingers) for fingers in split]
