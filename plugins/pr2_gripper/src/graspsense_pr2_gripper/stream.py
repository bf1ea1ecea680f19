"""Puts reports in order and assembles cell images; counts lost, late and damaged reports."""

from __future__ import annotations

from typing import Final, NamedTuple

from attrs import define

from graspsense_pr2_gripper.protocol import (
    IMAGE_CELLS,
    LAST_IMAGE,
    SAMPLES_MISSED,
    SLICE_CELLS,
    SLICES,
    InputReport,
    ProtocolError,
    decode_input,
)

_ALL_SLICES: Final = (1 << SLICES) - 1
_HALF: Final = 1 << 31
REMEMBERED: Final = 256
"""Number of lost reports that may still arrive late."""
RESTARTED: Final = 32
"""Number of consecutive reports with old sequence numbers after which the device counts as restarted."""


class RawImage(NamedTuple):
    """A complete cell image: `counter` increases by one with each, `cells` are the 44 of the board in its order."""

    counter: int
    time_us: int
    cells: tuple[float, ...]


class Restarted(Exception):
    """The sequence of the device restarted although the device was connected."""


@define
class Counts:
    """Counters of the reports since the device was opened."""

    reports: int = 0
    lost: int = 0
    corrupt: int = 0
    repeated: int = 0
    out_of_order: int = 0
    images: int = 0
    images_lost: int = 0
    accelerometer_samples: int = 0
    accelerometer_missed: int = 0


class Stream:
    """Processes the reports of one device in turn."""

    def __init__(self) -> None:
        self.counts = Counts()
        self.image: RawImage | None = None
        """The last complete image."""
        self.sampled = 0
        """Number of samples that the accelerometer has taken. Each lost report counts as the report after it."""
        self._last = -1
        self._missing: dict[int, None] = {}
        self._from_the_past = 0
        self._number = 0
        self._taken_us = 0
        self._have = 0
        self._cells = [0.0] * IMAGE_CELLS

    def take(self, data: bytes) -> InputReport | None:
        """Return the report if it is newer than all before, else None. Raises Restarted."""
        counts = self.counts
        try:
            report = decode_input(data)
        except ProtocolError:
            counts.corrupt += 1
            return None
        if self._last >= 0:
            ahead = (report.sequence - self._last) & 0xFFFFFFFF
            if ahead != 1:
                if ahead == 0 or ahead >= _HALF:
                    self._late(report)
                    return None
                self._remember(report.sequence, ahead - 1)
                counts.lost += ahead - 1
                self.sampled += len(report.samples) * (ahead - 1)
        self._last = report.sequence
        self._from_the_past = 0
        counts.reports += 1
        counts.accelerometer_samples += len(report.samples)
        self.sampled += len(report.samples)
        if report.status & SAMPLES_MISSED:
            counts.accelerometer_missed += 1
            self.sampled += 1
        if report.image:
            self._gather(report)
        return report

    def _late(self, report: InputReport) -> None:
        counts = self.counts
        if report.sequence in self._missing:
            del self._missing[report.sequence]
            counts.lost -= 1
            counts.out_of_order += 1
            if report.image:
                self._gather(report)
            return
        counts.repeated += 1
        self._from_the_past += 1
        if self._from_the_past >= RESTARTED:
            raise Restarted(f"its reports went back from number {self._last} to {report.sequence}")

    def _remember(self, sequence: int, lost: int) -> None:
        for back in range(min(lost, REMEMBERED), 0, -1):
            self._missing[(sequence - back) & 0xFFFFFFFF] = None
        while len(self._missing) > REMEMBERED:
            del self._missing[next(iter(self._missing))]

    def _gather(self, report: InputReport) -> None:
        counts = self.counts
        if report.image != self._number:
            ahead = (report.image - self._number) % LAST_IMAGE if self._number else 1
            if ahead > LAST_IMAGE // 2:
                return
            if self._number:
                counts.images_lost += ahead - 1 + (self._have != _ALL_SLICES)
            self._number, self._have = report.image, 0
            self._taken_us = report.time_us - report.image_age_us
        bit = 1 << report.slice
        if self._have & bit:
            return
        self._have |= bit
        start = report.slice * SLICE_CELLS
        # Converted slice by slice, since the tick in which an image is complete has enough to do.
        self._cells[start : start + SLICE_CELLS] = map(float, report.cells)
        if self._have == _ALL_SLICES:
            counts.images += 1
            self.image = RawImage(counts.images + counts.images_lost, self._taken_us, tuple(self._cells))
