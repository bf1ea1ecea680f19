"""When a step of the plant lasts several ticks, and how many. The loop runs sensors and controller in each of them."""

from __future__ import annotations

import math
from typing import Final

from graspsense_sim_gripper.plant.sensing import SensorState, next_image_s
from graspsense_sim_gripper.run.loop import Ahead, GraspParams, MacroControl, no_step
from graspsense_sim_gripper.solve.events import HALF
from graspsense_sim_gripper.solve.macro_step import (
    FIRST_TICKS,
    MAX_TICKS,
    MacroStep,
    constant_values,
    macro_step,
    next_ticks,
)
from graspsense_sim_gripper.solve.state import PlantState
from graspsense_sim_gripper.solve.trend import UNKNOWN

SHORTEST_ERROR: Final = 8.0
"""Largest error, relative to the tolerance, of a macro-step of `FIRST_TICKS`. Two steps of a tick, which would take its
place, are of lower order and less exact (docs/numerics.md, "Steps over several ticks")."""
MAX_WAIT: Final = 16
"""Most ticks to wait after a macro-step that was not accepted."""


def begin_macro_step(
    params: GraspParams,
    plant: PlantState,
    sensor: SensorState,
    effort_n: float,
    ticks: int,
    now: MacroControl,
) -> Ahead:
    """Return the macro-step that begins after the controller has run in the tick before `ticks`.

    None is taken if it would contain an event or have too large an error, and no cell image is taken before its end.
    """
    most = min(params.max_ticks - ticks, _ticks_to_image(params, sensor, ticks))
    if params.macro_steps == 0 or most < FIRST_TICKS:
        return no_step(plant, now)
    n, event = min(now.length, most), False
    step = MacroStep(
        error=math.inf, event_share=0.0, after=plant, values=constant_values(plant), trend=UNKNOWN
    )
    # In any other tick the plant has moved since the last macro-step ended.
    trend = now.trend if ticks == now.from_tick + 1 else UNKNOWN
    accepted = False
    while n >= FIRST_TICKS and not accepted:
        step = macro_step(params.plant, plant, effort_n, n * params.dt_s, trend)
        accepted = step.error <= (SHORTEST_ERROR if n == FIRST_TICKS else 1.0)
        if not accepted:
            event = event or not step.error < math.inf
            n = _fewer_ticks(n, step)
    if not accepted:
        wait = min(2 * now.wait, MAX_WAIT)
        return no_step(plant, MacroControl(FIRST_TICKS, ticks + wait, wait, UNKNOWN))
    # A step that an image cut short does not shorten the next one, and one that ends shortly before an event does.
    length = max(next_ticks(n, step.error, HALF), now.length if n == most else FIRST_TICKS)
    following = MacroControl(FIRST_TICKS if event else length, ticks + n - 1, 1, step.trend)
    return Ahead(n, step.values, step.after, following)


def _fewer_ticks(n: int, step: MacroStep) -> int:
    """Return the number of ticks with which a step of `n` that was not accepted is repeated; below 2: not at all."""
    fewer = next_ticks(n, step.error, step.event_share)
    return max(fewer, FIRST_TICKS) if step.error < math.inf and n > FIRST_TICKS else fewer


def _ticks_to_image(params: GraspParams, sensor: SensorState, ticks: int) -> int:
    """Return the number of ticks up to the one in which a cell image is taken or arrives, at least 1."""
    ahead = (next_image_s(params.sensor, sensor) - ticks * params.dt_s) / params.dt_s
    return max(math.ceil(min(ahead, float(MAX_TICKS))), 0) + 1
