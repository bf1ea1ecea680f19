"""What the gripper feels of the plant: a quantised encoder with its filter, and 22 cells a fingertip.

The encoder counts motor ticks; the gap is their image through the transmission, its rate a difference with a
first-order filter. A cell image is taken every 41 ms, or as the settings say, beside frames at the control rate: the
force that lands on the gripping face is spread over its fifteen cells by the patch of contact, the rest lands beside
them; each cell has an offset of its own, noise, whole counts and 16 bits. The ideal sensor gives gap, rate and force
exactly, at every tick, and has no cells. An image can be told to arrive later than it was taken, as over a bus that
carries it in pieces.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import (
    CELLS,
    FIRST_PAD_CELL,
    PAD_COUNTS_PER_N,
    PR2_ENCODER_TICKS,
    Frame,
    ScrewLinkage,
    edge_force,
    gap_and_rate,
    pad_force,
)
from graspsense_sim_gripper.plant import PlantState

VELOCITY_FILTER_S: Final = 0.003
"""Time constant of the rate's filter: below 10 ms, or the velocity loop becomes a limit cycle."""
LARGEST_COUNT: Final = 65535.0


class Bias(NamedTuple):
    """By what an ideal sensor is made wrong, to see whether a grasp hangs on so little."""

    force_n: float
    """On a pad that is touched."""
    share: float
    """Of the way that the fingers have come beyond `from_m`."""
    from_m: float


UNBIASED: Final = Bias(0.0, 0.0, 0.0)


class SensorParams(NamedTuple):
    """The sensing chain of one grasp. `share` is the part of the force that lands on the fifteen cells.

    A cell of the gripping face whose weight is 0 is not there: it reads its offset, always.
    """

    ideal: int
    link: ScrewLinkage
    pad_phase_s: float
    pad_period_s: float
    pad_delay_s: float
    share: float
    noise_counts: float
    left_weights: Any
    right_weights: Any
    left_offset: Any
    right_offset: Any
    bias: Bias = UNBIASED


class Felt(NamedTuple):
    """Forces of the last cell image, N."""

    left_n: float
    right_n: float
    left_edge_n: float
    right_edge_n: float


class SensorState(NamedTuple):
    """What was last read: encoder, gap and its rate, how many images so far, the forces of the last.

    `under_way` is 1 while an image is taken and has not arrived; `taken_*` are the forces on the pads it shows.
    """

    ticks: float
    gap_m: float
    velocity_m_s: float
    images: int
    image_t_s: float
    felt: Felt
    under_way: int
    taken_left_n: float
    taken_right_n: float


def first_sensed(params: SensorParams, plant: PlantState) -> SensorState:
    """Return the sensor before the first tick; the filter starts at rest."""
    ticks = float(math.floor(plant.revolutions * PR2_ENCODER_TICKS))
    gap, _ = gap_and_rate(params.link, ticks / PR2_ENCODER_TICKS)
    return SensorState(ticks, gap, 0.0, 0, 0.0, Felt(0.0, 0.0, 0.0, 0.0), 0, 0.0, 0.0)


def sense(
    params: SensorParams,
    state: SensorState,
    plant: PlantState,
    t_s: float,
    dt_s: float,
    effort_n: float,
    left_zero: Any,
    right_zero: Any,
    noise: Any,
    images: Any,
) -> tuple[Frame, SensorState]:
    """Return this tick's frame and the sensor's state.

    `noise[k]` holds 44 standard normal numbers for image k; a new image is written to `images[k][0]` (left)
    and `images[k][1]` (right).
    """
    if params.ideal == 1:
        velocity = plant.speed_rev_s * plant.rate_m_rev
        off_n, off_share, from_m = params.bias
        gap = plant.gap_m + off_share * min(plant.gap_m - from_m, 0.0)
        left_n = plant.left_n + off_n if plant.left_n > 0.0 else plant.left_n
        right_n = plant.right_n + off_n if plant.right_n > 0.0 else plant.right_n
        frame = Frame(t_s, dt_s, gap, velocity, effort_n, left_n, right_n, 0.0, 0.0, 0)
        return frame, state

    ticks, gap, velocity, count, image_t, felt, under_way, taken_left, taken_right = state
    now = float(math.floor(plant.revolutions * PR2_ENCODER_TICKS))
    moved = 0.0
    if now != ticks:
        ticks = now
        before = gap
        # Within a tick the transmission is straight to a tenth of a picometre.
        gap = plant.gap_m - plant.rate_m_rev * (plant.revolutions - ticks / PR2_ENCODER_TICKS)
        moved = gap - before
    velocity += dt_s / (VELOCITY_FILTER_S + dt_s) * (moved / dt_s - velocity)

    # A tenth of a nanosecond of grace, as ticks and image times are sums of different steps.
    due_s = params.pad_phase_s + count * params.pad_period_s - 1e-10
    if under_way == 0 and t_s >= due_s:
        under_way, taken_left, taken_right = 1, plant.left_n, plant.right_n
    if under_way == 1 and t_s >= due_s + params.pad_delay_s:
        left, right, drawn = images[count][0], images[count][1], noise[count]
        _image(params, params.left_weights, params.left_offset, taken_left, drawn, 0, left)
        _image(params, params.right_weights, params.right_offset, taken_right, drawn, CELLS, right)
        felt = feel(left, right, left_zero, right_zero)
        count, image_t, under_way = count + 1, t_s - params.pad_delay_s, 0
    frame = Frame(
        t_s, dt_s, gap, velocity, effort_n, felt.left_n, felt.right_n, felt.left_edge_n, felt.right_edge_n, 0
    )
    return frame, SensorState(ticks, gap, velocity, count, image_t, felt, under_way, taken_left, taken_right)


def feel(left: Any, right: Any, left_zero: Any, right_zero: Any) -> Felt:
    """Return the forces of one cell image of both fingertips over their zeros."""
    return Felt(
        pad_force(left, left_zero),
        pad_force(right, right_zero),
        edge_force(left, left_zero),
        edge_force(right, right_zero),
    )


def felt_again(state: SensorState, images: Any, left_zero: Any, right_zero: Any) -> SensorState:
    """Return the sensor with the last image's forces taken over a new zero."""
    last = images[state.images - 1]
    felt = feel(last[0], last[1], left_zero, right_zero)
    return SensorState(
        state.ticks,
        state.gap_m,
        state.velocity_m_s,
        state.images,
        state.image_t_s,
        felt,
        state.under_way,
        state.taken_left_n,
        state.taken_right_n,
    )


def _image(
    params: SensorParams, weights: Any, offset: Any, force_n: float, noise: Any, first: int, cells: Any
) -> None:
    counts = force_n * params.share * PAD_COUNTS_PER_N
    spread = params.noise_counts
    for i in range(CELLS):
        value = offset[i] + spread * noise[first + i]
        if i >= FIRST_PAD_CELL:
            weight = weights[i - FIRST_PAD_CELL]
            value = value + counts * weight if weight > 0.0 else offset[i]
        value = float(math.floor(value + 0.5))
        if value < 0.0:
            value = 0.0
        elif value > LARGEST_COUNT:
            value = LARGEST_COUNT
        cells[i] = value
