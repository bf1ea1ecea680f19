"""The memory that the grasps of a thread write to, one after the other; its growth, and the trace made of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import define, field
from numpy.typing import NDArray

from graspsense.gripper_api import Phase
from graspsense.plugin_api import GraspEvent, Trace
from graspsense.simulator_api import event_name
from graspsense_sim_gripper.plant.fingertip import CELL_OFFSET, CELLS
from graspsense_sim_gripper.plant.sensing import PadBuffers
from graspsense_sim_gripper.run.drawing import image_noise
from graspsense_sim_gripper.run.loop import COLUMNS, EVENT_SHIFT, Buffers
from graspsense_sim_gripper.scene.random_numbers import Word

TICKS: Final = 8200
"""Ticks that the buffers hold at first; a grasp that needs more continues with longer ones. It is not a power of two,
because all columns would then share one set of the processor's cache and evict each other."""
IMAGES: Final = 160
"""Cell images that the buffers hold at first, which suffice for nearly all grasps of the catalogue."""


def new_buffers(ticks: int = TICKS, images: int = IMAGES) -> Buffers:
    """Return buffers for the first grasp of a thread."""
    return Buffers(
        pads=PadBuffers(
            left_zero=np.zeros(CELLS),
            right_zero=np.zeros(CELLS),
            noise=np.zeros((images, 2 * CELLS)),
            images=np.full((images, 2, CELLS), np.nan),
        ),
        image_times=np.zeros(images),
        columns=np.zeros((len(COLUMNS), ticks)),
        phases=np.zeros(ticks, np.int64),
    )


@define(eq=False)
class Storage:
    """The buffers of a thread. Its grasps use them one after the other."""

    buffers: Buffers = field(factory=new_buffers)


def as_lists(buffers: Buffers) -> Buffers:
    """Return the same values for the interpreter, which indexes lists faster than arrays."""
    pads = PadBuffers(*(np.asarray(array).tolist() for array in buffers.pads))
    return Buffers(pads, *(np.asarray(array).tolist() for array in buffers[1:]))


def begin_images(buffers: Buffers) -> None:
    """Prepare arrays for the cell images of another grasp."""
    buffers.pads.images[-1] = math.nan
    buffers.pads.left_zero[:] = buffers.pads.right_zero[:] = CELL_OFFSET[0]


def longer(buffers: Buffers, key: Word | None) -> Buffers:
    """Return arrays for twice as many ticks and images, which begin with the same values.

    `key`: that of the seed, whose noise is in them; None: the sensors are ideal.
    """
    left_zero, right_zero, _, images = (np.asarray(array) for array in buffers.pads)
    # The loop draws noise on the way, and does not know any more how far it had come.
    noise = np.zeros((2 * len(images), 2 * CELLS)) if key is None else image_noise(key, 0, 2 * len(images))
    return Buffers(
        PadBuffers(left_zero, right_zero, noise, np.concatenate([images, np.full_like(images, math.nan)])),
        *(np.concatenate([array, np.zeros_like(array)], axis=-1) for array in map(np.asarray, buffers[1:])),
    )


def recorded_trace(
    event_names: Sequence[str],
    table: NDArray[np.float64],
    phases: NDArray[np.int64],
    images: NDArray[np.float64],
    times: NDArray[np.float64],
) -> Trace:
    """Return the trace of a grasp.

    `event_names`: `Controller.events`. `table`, shape (columns, n), and `phases`, shape (n,): `Buffers.columns` and
    `Buffers.phases`; the events are removed from the latter. `images` and `times`: the cell images, and when each was
    taken (s).
    """
    events: tuple[GraspEvent, ...] = ()
    if event_names:
        events = _take_events(event_names, table[0], phases)
    # The runner keeps the image that had arrived when the approach began, and those after it.
    begin = 0
    if len(phases) and len(times):
        begin = max(int(np.searchsorted(times, table[0, 0], side="right")) - 1, 0)
    images = images.reshape(-1, 2, CELLS)
    return Trace(
        **dict(zip(COLUMNS, table, strict=True)),
        status=np.zeros(len(phases), np.int64),
        phase=phases,
        pad_t_s=np.array(times[begin:]),
        pad_left=images[begin:, 0].copy(),
        pad_right=images[begin:, 1].copy(),
        events=events,
    )


def _take_events(
    names: Sequence[str], times: NDArray[np.float64], phases: NDArray[np.int64]
) -> tuple[GraspEvent, ...]:
    """Return the events that the loop wrote above the bits of the phases, and remove them there."""
    ticks = np.flatnonzero(phases >> EVENT_SHIFT).tolist()
    bits = (phases[ticks] >> EVENT_SHIFT).tolist()
    phases[ticks] &= (1 << EVENT_SHIFT) - 1
    return tuple(
        GraspEvent(float(times[tick]), Phase(int(phases[tick])), event_name(names, i), "controller")
        for tick, told in zip(ticks, bits, strict=True)
        for i in range(told.bit_length())
        if told >> i & 1
    )
