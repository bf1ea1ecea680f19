"""The ticks of macro-steps: in each the sensors and the controller, while the plant takes one step over all of them."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from graspsense.plugin_api import Command, Pads, Reading, TickParams, TickState
from graspsense_sim_gripper.dynamics.state import PlantState
from graspsense_sim_gripper.loop import (
    EVENT_SHIFT,
    NOT_NEGATIVE,
    GraspParams,
    LoopProgress,
    MacroControl,
    Table,
    control_unbound,
    move_unbound,
    record,
)
from graspsense_sim_gripper.sensing import SensorState, next_image_s, read_frame
from graspsense_sim_gripper.stepping.macro_step import (
    HALF,
    MAX_TICKS,
    MacroStep,
    constant_values,
    macro_step,
    next_ticks,
    values_at,
    with_peak,
)
from graspsense_sim_gripper.stepping.scheme import PlantParams, Steps
from graspsense_sim_gripper.stepping.trend import UNKNOWN

FIRST_TICKS: Final = 2
"""Number of ticks in the first macro-step."""
SHORTEST_ERROR: Final = 8.0
"""Largest error, relative to the tolerance, of a macro-step of `FIRST_TICKS`. Two steps of a tick, which would take its
place, are of lower order and less exact (docs/numerics.md, "Steps over several ticks")."""
MAX_WAIT: Final = 16
"""Most ticks to wait after a macro-step that was not accepted."""

move: Callable[[PlantParams, PlantState, float, float], PlantState] = move_unbound
control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = control_unbound


def run_macro_step(
    params: GraspParams, at: LoopProgress, now: MacroControl, pads: Pads, columns: Table, phases: Any
) -> tuple[LoopProgress, MacroControl]:
    """Run the ticks of a macro-step; return where they end, and the control of the next one.

    `at` is in a tick, after the controller and before the plant moves. The result is between two ticks, after the plant
    has moved; or it is `at`, if a step would contain an event or have too large an error. `pads` is the last cell
    image: none is taken before the end of the step.
    """
    most = min(params.max_ticks - at.ticks, _ticks_to_image(params, at.sensor, at.ticks))
    if most < FIRST_TICKS:
        return at, now
    n, event = min(now.length, most), False
    step = MacroStep(math.inf, 0.0, at.plant, constant_values(at.plant), UNKNOWN)
    # In any other tick the plant has moved since the last macro-step ended.
    trend = now.trend if at.ticks == now.from_tick + 1 else UNKNOWN
    accepted = False
    while n >= FIRST_TICKS and not accepted:
        step = macro_step(params.plant, at.plant, at.effort_n, n * params.dt_s, trend)
        accepted = step.error <= (SHORTEST_ERROR if n == FIRST_TICKS else 1.0)
        if not accepted:
            event = event or not step.error < math.inf
            n = _fewer_ticks(n, step)
    if not accepted:
        wait = min(2 * now.wait, MAX_WAIT)
        return at, MacroControl(FIRST_TICKS, at.ticks + wait, wait, UNKNOWN)
    # A step that an image cut short does not shorten the next one.
    length = max(next_ticks(n, step.error, HALF), now.length if n == most else FIRST_TICKS)
    after = _ticks_within(params, at, step, n, pads, columns, phases)
    # The step ends shortly before the event.
    if event or after.effort_n != at.effort_n:
        length = FIRST_TICKS
    trend = step.trend if after.effort_n == at.effort_n else UNKNOWN
    return after, MacroControl(length, after.ticks, 1, trend)


def _fewer_ticks(n: int, step: MacroStep) -> int:
    """Return the number of ticks with which a step of `n` that was not accepted is repeated; below 2: not at all."""
    fewer = next_ticks(n, step.error, step.event_share)
    return max(fewer, FIRST_TICKS) if step.error < math.inf and n > FIRST_TICKS else fewer


def _ticks_within(
    params: GraspParams, at: LoopProgress, step: MacroStep, n: int, pads: Pads, columns: Table, phases: Any
) -> LoopProgress:
    """Return the grasp after a macro-step of `n` ticks, or after the tick in which the effort changes or it ends."""
    dt_s = params.dt_s
    ticks, recorded, effort, plant, sensor, state = at
    command_n, peak, k = effort, plant.peak_n, 1
    while k < n and command_n == effort and state.done == 0 and state.guard.stopped == 0:
        measured = values_at(step.values, k / n)
        peak = max(peak, measured.left_n, measured.right_n)
        frame, sensor = read_frame(params.sensor, sensor, measured, ticks * dt_s, dt_s, effort)
        command, state = control(params.controller, state, Reading(frame, pads, ()))
        command_n = command.value
        row = recorded & NOT_NEGATIVE
        record(columns, row, frame, command_n)
        phases[row] = state.phase | state.events << EVENT_SHIFT
        recorded, ticks, k = recorded + 1, ticks + 1, k + 1
    after = step.after
    if command_n != effort or state.done == 1 or state.guard.stopped == 1:
        after = move(_held_at_once(params.plant, plant), plant, effort, (k - 1) * dt_s)
        if state.done == 0 and state.guard.stopped == 0:
            after = move(params.plant, after, command_n, dt_s)
    return LoopProgress(ticks, recorded, command_n, with_peak(after, max(after.peak_n, peak)), sensor, state)


def _held_at_once(model: PlantParams, plant: PlantState) -> PlantParams:
    """Return the model in which fingers at rest are held in one step. A macro-step showed how little relaxes."""
    drive, body, (tolerance, scheme, longest_s, settle, growth, touched_s, macro_tolerance) = model
    if plant.motion.speed_rev_s == 0.0:
        longest_s = math.inf
    return PlantParams(
        drive, body, Steps(tolerance, scheme, longest_s, settle, growth, touched_s, macro_tolerance)
    )


def _ticks_to_image(params: GraspParams, sensor: SensorState, ticks: int) -> int:
    """Return the number of ticks up to the one in which a cell image is taken or arrives, at least 1."""
    ahead = (next_image_s(params.sensor, sensor) - ticks * params.dt_s) / params.dt_s
    return max(math.ceil(min(ahead, float(MAX_TICKS))), 0) + 1
