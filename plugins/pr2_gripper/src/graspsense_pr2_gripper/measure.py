"""Conversion of the counts of the board to metres and newtons: linkage, tare, scales, load tables, dead cells."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

from graspsense.gripper_api import (
    LoadTable,
    TareRefused,
    cells_force,
    edge_force,
    gap_and_rate,
    load_of,
    masked,
    no_pads,
    pad_force,
    revolutions_at,
    tare,
)
from graspsense.plugin_api import Frame, Pads, Reading
from graspsense_pr2_gripper.accelerometer import Accelerometer
from graspsense_pr2_gripper.ceilings import GAPS_M, SENSOR_SPEED_M_S
from graspsense_pr2_gripper.config import Pr2Config
from graspsense_pr2_gripper.fingertip import CELLS, FIRST_PAD_CELL
from graspsense_pr2_gripper.linkage import LINKAGES, edge_scale
from graspsense_pr2_gripper.protocol import LEFT_ABSENT, RIGHT_ABSENT, SLICES, Identity, InputReport
from graspsense_pr2_gripper.status import (
    BAD_CELL,
    BEYOND_TABLE,
    ENCODER_WRONG,
    ENDURED_CELLS,
    LEFT_DEAD,
    OLD_IMAGE,
    RESULT_BITS,
    RIGHT_DEAD,
)
from graspsense_pr2_gripper.stream import RawImage

UNLOADED_COUNTS: Final = 4500.0
"""Without a stored tare, a pad whose cells read more than this in the mean counts as loaded: users report
2900 to 3800 without a load (public PressureListener scripts for the PR2, differing by finger and run)."""
STEP_M: Final = 0.5e-3
"""Change of the gap beyond which two reports are compared with the largest speed; a tick is at most 0.0016 mm."""

Tips = tuple[tuple[float, ...], tuple[float, ...]]

_MIRRORED: Final = (
    0,
    6,
    5,
    4,
    3,
    2,
    1,
    *(FIRST_PAD_CELL + 3 * row + c for row in range(5) for c in (2, 1, 0)),
)
"""The cells of a fingertip with the -z and +z sides swapped: sides, corners, tip cells, and the columns of the pad."""


class _PadForces(NamedTuple):
    left_n: float
    right_n: float
    left_edge_n: float
    right_edge_n: float
    status: int


_NO_FORCES: Final = _PadForces(
    left_n=math.nan, right_n=math.nan, left_edge_n=math.nan, right_edge_n=math.nan, status=0
)


class Measure:
    """Converts the reports of one device, in order, to readings.

    `stored` is the zero of a stored tare, `tables` are the load tables of left and right, `gains` the counts under one
    newton of each of their cells; None if there are none.
    """

    def __init__(
        self,
        identity: Identity,
        config: Pr2Config,
        stored: Tips | None,
        tables: tuple[LoadTable, LoadTable] | None,
        gains: Tips | None = None,
    ) -> None:
        self._link = LINKAGES[identity.transmission]
        self._period_us = round(1e6 / identity.report_rate_hz)
        # The board keeps an image until the next one is latched, or until all its slices have been sent.
        self._oldest_us = (
            max(identity.image_period_us, SLICES * self._period_us) + identity.image_period_us // 2
        )
        self._ticks_rev = float(identity.encoder_ticks_rev)
        self._pad_per_n = float(identity.pad_counts_per_n)
        side, edge = float(identity.side_counts_per_n), float(identity.edge_counts_per_n)
        self._edge_per_n = edge_scale(side, edge)
        self._swap, self._mirror = config.swap_fingers, (config.mirror_left, config.mirror_right)
        self._stored, self._tables = stored, tables
        # The sum of the cells has the counts of the board; a gain of each cell takes its place.
        self._gains = gains
        self._zero: Tips | None = stored
        self._accelerometer = Accelerometer(identity.accelerometer_g) if config.accelerometer else None
        self._pads = no_pads(CELLS)
        self._forces = _NO_FORCES
        self._ticks = tuple(revolutions_at(self._link, gap_m) * self._ticks_rev for gap_m in GAPS_M)
        self._gap_m = math.nan
        self._first_us: int | None = None
        self._last_us = 0
        self.bad_cells = 0
        """Largest number of dead cells in one image."""
        self.image_age_s = 0.0
        """Time from the last cell image to the report in which it was complete."""

    def reading(
        self, report: InputReport, image: RawImage | None, words: tuple[int, ...] = (), sampled: int = 0
    ) -> Reading:
        """Return the reading of this report, with the last complete cell image and the new samples (see `Arrival`)."""
        if self._first_us is None:
            self._first_us = report.time_us
            self._last_us = report.time_us - self._period_us
        if image is not None and image.counter != self._pads.counter:
            self._take(image)
            self.image_age_s = 1e-6 * (report.time_us - image.time_us)
        gap, rate = gap_and_rate(self._link, report.encoder_ticks / self._ticks_rev)
        forces, status = self._forces, report.status | self._encoder_status(report, gap)
        if report.command_result in RESULT_BITS:
            status |= RESULT_BITS[report.command_result]
        if report.image_age_us > self._oldest_us and report.image:
            status |= OLD_IMAGE
        left, right = forces.left_n, forces.right_n
        if status & (LEFT_ABSENT | RIGHT_ABSENT):
            swap = self._swap
            left = math.nan if status & (RIGHT_ABSENT if swap else LEFT_ABSENT) else left
            right = math.nan if status & (LEFT_ABSENT if swap else RIGHT_ABSENT) else right
        frame = Frame(
            t_s=(report.time_us - self._first_us) / 1e6,
            dt_s=(report.time_us - self._last_us) / 1e6,
            gap_m=gap,
            velocity_m_s=report.velocity_mtick_s / 1e3 / self._ticks_rev * rate,
            effort_n=report.effort_un / 1e6,
            force_left_n=left,
            force_right_n=right,
            edge_left_n=forces.left_edge_n,
            edge_right_n=forces.right_edge_n,
            status=status | forces.status,
        )
        self._last_us = report.time_us
        if self._accelerometer is None:
            return Reading(frame, self._pads)
        return Reading(frame, self._pads, self._accelerometer.signals(frame.t_s, words, sampled))

    def _encoder_status(self, report: InputReport, gap_m: float) -> int:
        """Return the bit of an implausible encoder, or 0.

        The angle itself is held against the stroke, since the map to the gap gives one for any angle.
        """
        step_m, self._gap_m = abs(gap_m - self._gap_m), gap_m
        jumped = step_m > STEP_M and step_m > SENSOR_SPEED_M_S * 1e-6 * (report.time_us - self._last_us)
        if jumped or not self._ticks[0] <= report.encoder_ticks <= self._ticks[1]:
            return ENCODER_WRONG
        return 0

    def tare(self, images: Sequence[Pads]) -> None:
        """Set the zero from these images. Raises TareRefused."""
        zero = tare(images, self._pad_per_n, FIRST_PAD_CELL, self._stored)
        if self._stored is None:
            for side, cells in zip(("left", "right"), zero, strict=True):
                good = [cell for cell in cells[FIRST_PAD_CELL:] if cell]
                mean = sum(good) / len(good) if good else 0.0
                if mean > UNLOADED_COUNTS:
                    raise TareRefused(
                        f"the {side} pad reads {mean:.0f} counts per cell; an unloaded one reads at most "
                        f"{UNLOADED_COUNTS:.0f}: empty the gripper and try again. If nothing touches the pad, store "
                        "its zero once with `graspsense calibrate tare --replace`"
                    )
        self._zero = zero
        if self._pads.counter:
            self._compute_forces()

    def _take(self, image: RawImage) -> None:
        left, right = image.cells[:CELLS], image.cells[CELLS:]
        if self._swap:
            left, right = right, left
        if self._mirror[0]:
            left = tuple([left[i] for i in _MIRRORED])
        if self._mirror[1]:
            right = tuple([right[i] for i in _MIRRORED])
        first_us = self._first_us if self._first_us is not None else 0
        self._pads = Pads((image.time_us - first_us) / 1e6, image.counter, left, right)
        self._compute_forces()

    def _compute_forces(self) -> None:
        pads = self._pads
        # Without a tare, a cell is dead by its value alone.
        zero = (pads.left, pads.right) if self._zero is None else self._zero
        left, left_bad = masked(pads.left, zero[0])
        right, right_bad = masked(pads.right, zero[1])
        bad = left_bad + right_bad
        self.bad_cells = max(self.bad_cells, bad)
        status = 0
        if bad:
            status = BAD_CELL | _dead(LEFT_DEAD, pads.left, zero[0]) | _dead(RIGHT_DEAD, pads.right, zero[1])
        if self._zero is None:
            # Without a tare there is no force: the offsets alone are some thousand counts for each cell.
            self._forces = _PadForces(
                left_n=0.0, right_n=0.0, left_edge_n=0.0, right_edge_n=0.0, status=status
            )
            return
        if self._gains is None:
            left_n = pad_force(left, zero[0], self._pad_per_n, FIRST_PAD_CELL)
            right_n = pad_force(right, zero[1], self._pad_per_n, FIRST_PAD_CELL)
        else:
            left_n = cells_force(left, zero[0], self._gains[0], FIRST_PAD_CELL)
            right_n = cells_force(right, zero[1], self._gains[1], FIRST_PAD_CELL)
        if self._tables is not None:
            left_n, left_inside = load_of(self._tables[0], left_n)
            right_n, right_inside = load_of(self._tables[1], right_n)
            if not (left_inside and right_inside):
                status |= BEYOND_TABLE
        self._forces = _PadForces(
            left_n=math.nan if left_bad == CELLS else left_n,
            right_n=math.nan if right_bad == CELLS else right_n,
            left_edge_n=edge_force(left, zero[0], self._edge_per_n),
            right_edge_n=edge_force(right, zero[1], self._edge_per_n),
            status=status,
        )


def _dead(bit: int, cells: tuple[float, ...], zero: tuple[float, ...]) -> int:
    """Return the bit if too many cells on the face of a pad do not answer, else 0."""
    return bit if masked(cells[FIRST_PAD_CELL:], zero[FIRST_PAD_CELL:])[1] > ENDURED_CELLS else 0
