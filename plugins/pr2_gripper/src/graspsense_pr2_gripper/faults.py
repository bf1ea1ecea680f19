"""Faults of an emulated board: reports and commands that are lost, damaged or late, and frozen cells."""

from __future__ import annotations

import random
from collections import deque
from heapq import heappop, heappush

from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.firmware import Firmware
from graspsense_pr2_gripper.protocol import SLICE_CELLS, decode_input, encode_input


class Wire:
    """Transmits reports and commands of one firmware with the faults of the config, at random from `seed`."""

    def __init__(self, firmware: Firmware, faults: FaultConfig, seed: int) -> None:
        self.firmware = firmware
        self.unplugged = False
        self._faults = faults
        self._behaves = faults == FaultConfig()
        self._chance = random.Random(seed)
        self._late: list[tuple[int, int, bytes]] = []
        self._held: deque[bytes] = deque()
        self._steps = 0
        self._frozen: int | None = None

    def step(self) -> list[bytes]:
        """Advance by one period; return the reports that reach the host in it."""
        faults, chance = self._faults, self._chance
        report = self.firmware.step()
        if self._behaves:
            return [] if self.unplugged else [report]
        now_us = self.firmware.time_us
        self._steps += 1
        if now_us >= faults.unplug_at_s * 1e6:
            self.unplugged = True
        if self.unplugged or self._stalled(now_us):
            return []
        arriving: list[bytes] = []
        while self._late and self._late[0][0] <= now_us:
            arriving.append(heappop(self._late)[2])
        if faults.freeze_cell >= 0 or faults.drift_counts_s:
            report = self._cells_gone_wrong(report, now_us)
        if chance.random() < faults.corrupt:
            report = _flipped(report, chance)
        if chance.random() < faults.drop:
            return arriving
        if chance.random() < faults.delay:
            heappush(self._late, (now_us + round(faults.delay_s * 1e6), self._steps, report))
            return arriving
        if chance.random() < faults.reorder:
            self._held.append(report)
            return arriving
        arriving.append(report)
        arriving.extend(self._held)
        self._held.clear()
        if chance.random() < faults.repeat:
            arriving.append(report)
        return arriving

    def output(self, data: bytes) -> None:
        """Transmit a command to the firmware."""
        faults, chance = self._faults, self._chance
        if self.unplugged or self._stalled(self.firmware.time_us) or chance.random() < faults.drop_command:
            return
        if chance.random() < faults.corrupt_command:
            data = _flipped(data, chance)
        self.firmware.output(data)

    def _stalled(self, now_us: int) -> bool:
        faults = self._faults
        return faults.stall_at_s * 1e6 <= now_us < (faults.stall_at_s + faults.stall_s) * 1e6

    def _cells_gone_wrong(self, data: bytes, now_us: int) -> bytes:
        faults = self._faults
        report = decode_input(data)
        drift = round(faults.drift_counts_s * now_us * 1e-6)
        cells = [min(max(cell + drift, 0), 0xFFFF) for cell in report.cells]
        slice_, cell = divmod(faults.freeze_cell, SLICE_CELLS)
        if report.slice == slice_ and report.image and now_us >= faults.freeze_at_s * 1e6:
            if self._frozen is None:
                self._frozen = cells[cell]
            cells[cell] = self._frozen
        return encode_input(report._replace(cells=tuple(cells)))  # type: ignore[arg-type]


def _flipped(data: bytes, chance: random.Random) -> bytes:
    damaged = bytearray(data)
    damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    return bytes(damaged)
