"""Faults of the connection of an emulated board: reports and commands that are lost, damaged or late."""

from __future__ import annotations

import random
from collections import deque
from heapq import heappop, heappush

from graspsense_pr2_gripper.board_faults import BoardFaults
from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.firmware import Firmware


class Wire:
    """Transmits reports and commands of one firmware with the faults of the config, at random from `seed`."""

    def __init__(self, firmware: Firmware, faults: FaultConfig, seed: int) -> None:
        self.firmware = firmware
        self.unplugged = False
        self._faults = faults
        self._behaves = faults == FaultConfig()
        self._board = BoardFaults(faults)
        self._chance = random.Random(seed)
        self._late: list[tuple[int, int, bytes]] = []
        self._held: deque[bytes] = deque()
        self._steps = 0

    def step(self) -> list[bytes]:
        """Advance by one period; return the reports that reach the host in it."""
        faults, chance = self._faults, self._chance
        if self._behaves:
            report = self.firmware.step()
            return [] if self.unplugged else [report]
        self.firmware.motor_gain = self._board.motor_gain(self.firmware.time_us)
        report = self.firmware.step()
        now_us = self.firmware.time_us
        self._steps += 1
        if now_us >= faults.unplug_at_s * 1e6:
            self.unplugged = True
        if self.unplugged or self._stalled(now_us):
            return []
        arriving: list[bytes] = []
        while self._late and self._late[0][0] <= now_us:
            arriving.append(heappop(self._late)[2])
        report = self._board.altered(report, now_us)
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

    def feature(self) -> bytes:
        """Return the feature report, or as much of it as arrives."""
        return self.firmware.feature()[: self._faults.feature_bytes]

    def _stalled(self, now_us: int) -> bool:
        faults = self._faults
        return faults.stall_at_s * 1e6 <= now_us < (faults.stall_at_s + faults.stall_s) * 1e6


def _flipped(data: bytes, chance: random.Random) -> bytes:
    damaged = bytearray(data)
    damaged[chance.randrange(len(damaged))] ^= 1 << chance.randrange(8)
    return bytes(damaged)
