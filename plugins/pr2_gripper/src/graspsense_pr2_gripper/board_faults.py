"""Faults of an emulated board itself, on a good connection: fingertips, images, status, motor, effort, and clock."""

from __future__ import annotations

from typing import Final

from graspsense_pr2_gripper.config import FaultConfig
from graspsense_pr2_gripper.fingertip import CELLS
from graspsense_pr2_gripper.protocol import (
    LEFT_ABSENT,
    RIGHT_ABSENT,
    SLICE_CELLS,
    InputReport,
    decode_input,
    encode_input,
)

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
