"""The sensors of the gripper: a quantised encoder with a velocity filter, and 22 pressure cells per fingertip.

The encoder counts ticks of the motor's angle, and the linkage gives the gap. The rate of the gap is a difference that a
first-order low-pass filter smooths. Frames have the control rate. Cell images have a period of their own, 41 ms by
default, and may arrive later than they are taken, as over a bus that transmits an image in parts.

The shape of the contact distributes the force over the fifteen cells of the gripping face; a part of the force may land
beside them. A cell has an offset, noise, integer counts and 16 bits. The ideal sensor gives gap, rate and forces
exactly at every tick, and has no cells.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

import numpy as np

from graspsense.gripper_api import ScrewLinkage, edge_force, gap_and_rate, pad_force
from graspsense.plugin_api import Frame
from graspsense_sim_gripper.plant.drive_models import ENCODER_TICKS
from graspsense_sim_gripper.plant.fingertip import CELLS, FIRST_PAD_CELL
from graspsense_sim_gripper.plant.state import Motion, PlantReadings

VELOCITY_FILTER_S: Final = 0.003
"""Time constant of the velocity filter. From 10 ms on, velocity control runs into a limit cycle."""
LARGEST_COUNT: Final = 65535.0
"""The largest reading of a cell: 16 bits."""
PAD_COUNTS_PER_N: Final = 1600.0
"""Counts of the sum of the fifteen cells of the PR2's gripping face under one newton (fingertip_pressure, scripts/
fingertip_geometry.py). The driver of the real gripper has the same scales: `tests/sources/test_pr2_numbers.py`."""
EDGE_COUNTS_PER_N: Final = (600.0, 400.0, 600.0, 600.0, 600.0, 600.0, 400.0)
"""Counts per newton of each of the cells 0 to 6: back, side, corner, tip, tip, corner, side. Source as above."""
CLOCK_TOLERANCE_S: Final = 1e-10
"""Tolerance for an image that is due at a tick: both times are rounded differently."""

CellColumn = Any
"""A number for each cell: an array in compiled code, a list or tuple in the interpreter."""


class ImageClock(NamedTuple):
    """When cell images are taken, and when they arrive."""

    phase_s: float
    """Time of the first image."""
    period_s: float
    delay_s: float
    """From the time when an image is taken until it arrives."""


class PadCells(NamedTuple):
    """The cells of one fingertip."""

    weights: CellColumn
    """(15,) The share of each cell in the force on the gripping face. A cell with weight 0 always reads its offset."""
    offset: CellColumn
    """(22,) Counts of the unloaded cells."""


class SensorParams(NamedTuple):
    """The sensors of one grasp."""

    ideal: int
    """1: exact values; 0: encoder and cells."""
    link: ScrewLinkage
    clock: ImageClock
    share: float
    """The share of the force on a pad that lands on the fifteen cells of its gripping face."""
    noise_counts: float
    """Standard deviation of the noise of a cell."""
    left: PadCells
    right: PadCells


class PadBuffers(NamedTuple):
    """The cell images of a grasp, written in place: arrays in compiled code, lists in the interpreter."""

    left_zero: CellColumn
    right_zero: CellColumn
    """(22,) The counts of each cell that stand for no force."""
    noise: Any
    """(k, 44) Standard normal numbers for each image."""
    images: Any
    """(k, 2, 22) Counts of the left and the right fingertip in each image."""


class PadForces(NamedTuple):
    """Forces of a cell image (N): on the gripping faces, and on the cells of the edges."""

    left_n: float
    right_n: float
    left_edge_n: float
    right_edge_n: float


class Pending(NamedTuple):
    """The cell image that was taken and has not yet arrived."""

    waiting: int
    """1: there is one."""
    left_n: float
    right_n: float
    """The forces on the pads when it was taken."""


class EncoderReading(NamedTuple):
    """What the encoder shows: its ticks, and the gap and the filtered rate that are computed from them."""

    ticks: float
    gap_m: float
    velocity_m_s: float


class CellReading(NamedTuple):
    """What the cells show."""

    images: int
    """Number of cell images so far."""
    image_t_s: float
    """Time at which the last of them was taken."""
    forces: PadForces
    """The forces of the last image."""
    pending: Pending


class SensorState(NamedTuple):
    """The last readings."""

    encoder: EncoderReading
    cells: CellReading


def with_listed_cells(params: SensorParams) -> SensorParams:
    """Return the same sensors for the interpreter, which indexes lists faster than arrays."""
    if params.ideal == 1:
        return params
    left, right = (
        PadCells(cells.weights.tolist(), cells.offset.tolist()) for cells in (params.left, params.right)
    )
    return params._replace(left=left, right=right)


def initial_sensor(link: ScrewLinkage, motion: Motion) -> SensorState:
    """Return the sensor's state before the first tick; the velocity filter starts at rest."""
    ticks = float(math.floor(motion.revolutions * ENCODER_TICKS))
    gap, _ = gap_and_rate(link, ticks / ENCODER_TICKS)
    cells = CellReading(0, 0.0, PadForces(0.0, 0.0, 0.0, 0.0), Pending(0, 0.0, 0.0))
    return SensorState(EncoderReading(ticks, gap, 0.0), cells)


def sense(
    params: SensorParams,
    state: SensorState,
    measured: PlantReadings,
    t_s: float,
    dt_s: float,
    effort_n: float,
    pads: PadBuffers,
) -> tuple[Frame, SensorState]:
    """Return the frame at `t_s` (s) and the new state of the sensors; a new image is written to `pads.images`.

    `effort_n` is the commanded effort (N), which the frame repeats.
    """
    if params.ideal == 0:
        state = _with_image(params, state, measured, t_s, pads)
    encoder = sense_motion(params, state.encoder, measured.motion, dt_s)
    left_n, right_n, left_edge_n, right_edge_n = state.cells.forces
    if params.ideal == 1:
        left_n, right_n, left_edge_n, right_edge_n = measured.left_n, measured.right_n, 0.0, 0.0
    else:
        state = SensorState(encoder, state.cells)
    frame = Frame(
        t_s=t_s,
        dt_s=dt_s,
        gap_m=encoder.gap_m,
        velocity_m_s=encoder.velocity_m_s,
        effort_n=effort_n,
        force_left_n=left_n,
        force_right_n=right_n,
        edge_left_n=left_edge_n,
        edge_right_n=right_edge_n,
        status=0,
    )
    return frame, state


def _with_image(
    params: SensorParams, state: SensorState, measured: PlantReadings, t_s: float, pads: PadBuffers
) -> SensorState:
    """Return the state of the sensors with the image that is taken, or that arrives, at `t_s`, if there is one."""
    count, image_t, forces, pending = state.cells
    due_s = image_due_s(params, state)
    if pending.waiting == 0 and t_s >= due_s:
        pending = Pending(1, measured.left_n, measured.right_n)
    if pending.waiting == 1 and t_s >= due_s + params.clock.delay_s:
        image, noise = pads.images[count], pads.noise[count]
        _write_image(params, params.left, pending.left_n, noise, 0, image[0])
        _write_image(params, params.right, pending.right_n, noise, CELLS, image[1])
        forces = image_forces(image[0], image[1], pads)
        count, image_t = count + 1, t_s - params.clock.delay_s
        pending = Pending(0, pending.left_n, pending.right_n)
    return SensorState(state.encoder, CellReading(count, image_t, forces, pending))


def sense_motion(params: SensorParams, last: EncoderReading, motion: Motion, dt_s: float) -> EncoderReading:
    """Return what the encoder shows of this motion, given what it has shown last."""
    last_ticks, gap, velocity = last
    if params.ideal == 1:
        return EncoderReading(last_ticks, motion.gap_m, motion.speed_rev_s * motion.jacobian_m_rev)
    # A division for all ticks, which a compiler takes out of the loop. Few operations wait for the motion, which is
    # known last; `math.floor` would convert to an integer and back.
    share = 1.0 / (VELOCITY_FILTER_S + dt_s)
    velocity -= (dt_s * share) * velocity
    angle = motion.revolutions * ENCODER_TICKS
    ticks = float(np.floor(angle))
    if ticks != last_ticks:
        # Over one encoder tick the linkage is linear to a tenth of a picometre.
        gap_before = gap
        gap = motion.gap_m - (motion.jacobian_m_rev * (1.0 / ENCODER_TICKS)) * (angle - ticks)
        velocity += share * (gap - gap_before)
    return EncoderReading(ticks, gap, velocity)


def image_due_s(params: SensorParams, state: SensorState) -> float:
    """Return the time from which on the next image is taken; that of an ideal sensor, which takes none, is inf."""
    if params.ideal == 1:
        return math.inf
    return params.clock.phase_s + state.cells.images * params.clock.period_s - CLOCK_TOLERANCE_S


def next_image_s(params: SensorParams, state: SensorState) -> float:
    """Return the time at which an image is taken next, or at which the one that was taken arrives."""
    due_s = image_due_s(params, state)
    return due_s + params.clock.delay_s if state.cells.pending.waiting == 1 else due_s


def image_forces(left: CellColumn, right: CellColumn, pads: PadBuffers) -> PadForces:
    """Return the forces (N) of one cell image of both fingertips, relative to their zeros."""
    return PadForces(
        pad_force(left, pads.left_zero, PAD_COUNTS_PER_N, FIRST_PAD_CELL),
        pad_force(right, pads.right_zero, PAD_COUNTS_PER_N, FIRST_PAD_CELL),
        edge_force(left, pads.left_zero, EDGE_COUNTS_PER_N),
        edge_force(right, pads.right_zero, EDGE_COUNTS_PER_N),
    )


def apply_tare(state: SensorState, pads: PadBuffers) -> SensorState:
    """Return the state of the sensors, with the forces of the last image computed again from the present zeros."""
    count, image_t, _, pending = state.cells
    last = pads.images[count - 1]
    forces = image_forces(last[0], last[1], pads)
    return SensorState(state.encoder, CellReading(count, image_t, forces, pending))


def _write_image(
    params: SensorParams, pad: PadCells, force_n: float, noise: CellColumn, begin: int, cells: CellColumn
) -> None:
    """Write the counts of one fingertip under this force (N) to `cells`; its noise begins at `noise[first]`."""
    counts = force_n * params.share * PAD_COUNTS_PER_N
    spread = params.noise_counts
    for i in range(CELLS):
        value = pad.offset[i] + spread * noise[begin + i]
        if i >= FIRST_PAD_CELL:
            weight = pad.weights[i - FIRST_PAD_CELL]
            value = value + counts * weight if weight > 0.0 else pad.offset[i]
        value = float(math.floor(value + 0.5))
        if value < 0.0:
            value = 0.0
        elif value > LARGEST_COUNT:
            value = LARGEST_COUNT
        cells[i] = value
