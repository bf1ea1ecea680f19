"""The trace of a simulated grasp, made of the table that the loop has written."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from graspsense.gripper_api import Phase
from graspsense.plugin_api import GraspEvent, Trace
from graspsense.simulator_api import event_name
from graspsense_sim_gripper.plant.fingertip import CELLS
from graspsense_sim_gripper.run.loop import COLUMNS, EVENT_SHIFT


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
