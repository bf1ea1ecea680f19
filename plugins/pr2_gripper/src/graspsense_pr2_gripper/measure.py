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


class _PadForce(NamedTuple):
    """The forces on a pad and its edges, the number of its dead cells, and its status bits."""

    force_n: float
    edge_n: float
    bad: int
    status: int


_NO_FORCE: Final = _PadForce(force_n=math.nan, edge_n=math.nan, bad=0, status=0)


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
        self._forces = (_NO_FORCE, _NO_FORCE)
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
        of_left, of_right = self._forces
        status = report.status | of_left.status | of_right.status | self._encoder_status(report, gap)
        if report.command_result in RESULT_BITS:
            status |= RESULT_BITS[report.command_result]
        if report.image_age_us > self._oldest_us and report.image:
            status |= OLD_IMAGE
        left, right = of_left.force_n, of_right.force_n
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
            edge_left_n=of_left.edge_n,
            edge_right_n=of_right.edge_n,
            status=status,
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
        left, right = self._pads.left, self._pads.right
        # Without a tare, a cell is dead by its value alone.
        zero = (left, right) if self._zero is None else self._zero
        self._forces = self._of_pad(0, left, zero[0]), self._of_pad(1, right, zero[1])
        self.bad_cells = max(self.bad_cells, sum(pad.bad for pad in self._forces))

    def _of_pad(self, side: int, cells: tuple[float, ...], zero: tuple[float, ...]) -> _PadForce:
        """Return the forces on the left (0) or the right pad."""
        good, bad = masked(cells, zero)
        status = BAD_CELL if bad else 0
        if bad and masked(cells[FIRST_PAD_CELL:], zero[FIRST_PAD_CELL:])[1] > ENDURED_CELLS:
            status = (LEFT_DEAD, RIGHT_DEAD)[side]
        if self._zero is None:
            # Without a tare there is no force: the offsets alone are some thousand counts for each cell.
            return _PadForce(force_n=0.0, edge_n=0.0, bad=bad, status=status)
        if self._gains is None:
            force_n = pad_force(good, zero, self._pad_per_n, FIRST_PAD_CELL)
        else:
            force_n = cells_force(good, zero, self._gains[side], FIRST_PAD_CELL)
        if self._tables is not None:
            force_n, inside = load_of(self._tables[side], force_n)
            status |= 0 if inside else BEYOND_TABLE
        return _PadForce(
            force_n=math.nan if bad == CELLS else force_n,
            edge_n=edge_force(good, zero, self._edge_per_n),
            bad=bad,
            status=status,
        )
