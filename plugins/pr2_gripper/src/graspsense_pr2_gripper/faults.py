"""Faults of an emulated board: those of itself, and of its connection, which loses, damages and delays reports."""

from __future__ import annotations

import random
from collections import deque
from heapq import heappop, heappush
from typing import Final

from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.fingertip import CELLS
from graspsense_pr2_gripper.firmware import Firmware
from graspsense_pr2_gripper.protocol import (
    LEFT_ABSENT,
    RIGHT_ABSENT,
    SLICE_CELLS,
    InputReport,
    decode_input,
    encode_input,
)


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


_ABSENT: Final = {"left": LEFT_ABSENT, "right": RIGHT_ABSENT, "both": LEFT_ABSENT | RIGHT_ABSENT}
_CELLS: Final = {"left": range(CELLS), "right": range(CELLS, 2 * CELLS), "both": range(2 * CELLS)}
_LARGEST: Final = 2**31 - 1


class BoardFaults:
    """Changes the reports of one board, in order, as the config says."""

    def __init__(self, faults: FaultConfig) -> None:
        self._faults = faults
        self._kept: dict[int, int] = {}
        """The value that each stuck cell keeps."""
        self._image: tuple[int, int] | None = None
        """Number and device time (µs) of the image that the counter stands at."""

    def motor_gain(self, now_us: int) -> float:
        """Return applied effort over commanded effort at this device time."""
        return self._faults.motor_gain if now_us >= self._faults.motor_at_s * 1e6 else 1.0

    def altered(self, data: bytes, now_us: int) -> bytes:
        """Return the report as the faulty board sends it at this device time."""
        report, faults = decode_input(data), self._faults
        report = report._replace(cells=self._cells(report, now_us))
        status = report.status
        if faults.pad_fault == "absent" and now_us >= faults.pad_at_s * 1e6:
            status |= _ABSENT[faults.pad_side]
        if now_us >= faults.status_at_s * 1e6:
            status |= faults.status_bits
        if faults.image_fault != "none" and report.image and now_us >= faults.image_at_s * 1e6:
            report = self._with_old_image(report, now_us)
        effort_un = report.effort_un
        if now_us >= faults.effort_report_at_s * 1e6:
            effort_un = min(max(round(effort_un * faults.effort_report_gain), -_LARGEST), _LARGEST)
        time_us, changed_us = report.time_us, round(min(faults.clock_at_s * 1e6, now_us))
        time_us = changed_us + round((now_us - changed_us) * faults.clock_rate)
        return encode_input(report._replace(status=status, effort_un=effort_un, time_us=time_us))

    def _cells(self, report: InputReport, now_us: int) -> tuple[int, int, int, int]:
        """Return the four cells with drift, and with those that are stuck or read 0."""
        faults = self._faults
        start = report.slice * SLICE_CELLS
        if not report.image:
            return report.cells
        pad = _CELLS[faults.pad_side] if now_us >= faults.pad_at_s * 1e6 else range(0)
        drift = round(faults.drift_counts_s * (now_us * 1e-6 - faults.pad_at_s))
        cells = list(report.cells)
        for i, cell in enumerate(range(start, start + SLICE_CELLS)):
            if cell in pad:
                cells[i] = min(max(cells[i] + drift, 0), 0xFFFF)
            frozen = cell == faults.freeze_cell and now_us >= faults.freeze_at_s * 1e6
            if frozen or (faults.pad_fault in ("stuck", "numb") and cell in pad):
                cells[i] = self._kept.setdefault(cell, cells[i])
                if faults.pad_fault == "numb" and not frozen:
                    cells[i] = min(max(cells[i] + _noise(report.image, cell), 1), 0xFFFE)
            if faults.pad_fault == "zero" and cell in pad:
                cells[i] = 0
        return cells[0], cells[1], cells[2], cells[3]

    def _with_old_image(self, report: InputReport, now_us: int) -> InputReport:
        if self._image is None:
            self._image = report.image, now_us - report.image_age_us
        number, taken_us = self._image
        age_us = report.image_age_us
        if self._faults.image_fault == "stale":
            age_us = min(now_us - taken_us, 0xFFFF)
        return report._replace(image=number, image_age_us=age_us)


def _noise(image: int, cell: int) -> int:
    """Return -3 to 3 counts, the same in each slice of an image."""
    return (image * 7919 + cell * 104729) % 7 - 3
