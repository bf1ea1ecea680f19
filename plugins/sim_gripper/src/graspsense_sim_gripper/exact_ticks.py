"""Ticks of an exactly discretised plant, run at once while it stays in one mode and the controller in one phase.

In each of them the sensors are read, the controller is called and a row is recorded, as tick by tick, but the state of
the plant remains in the workspace of `exact.run`. The results are the same to the bit.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from graspsense.plugin_api import Command, Pads, Reading, TickParams, TickState
from graspsense_sim_gripper.dynamics.state import PlantReadings
from graspsense_sim_gripper.exact.run import begin_run, end_run, run_tick
from graspsense_sim_gripper.loop import (
    EVENT_SHIFT,
    NOT_NEGATIVE,
    ROWS_AT_ONCE,
    GraspParams,
    LoopProgress,
    MacroControl,
    Table,
    control_unbound,
    record,
)
from graspsense_sim_gripper.sensing import next_image_s, read_frame

control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = control_unbound


def exact_ticks(
    params: GraspParams, at: LoopProgress, now: MacroControl, pads: Pads, columns: Table, phases: Any
) -> tuple[LoopProgress, MacroControl]:
    """Run ticks up to one in which the mode may end or an image is due, or in which the phase or the grasp has ended.

    `at` and the result are in a tick, after the controller and before the plant moves. `pads` is the last cell image.
    `now` is returned as it is.
    """
    dt_s, exact = params.dt_s, params.plant
    ticks, recorded, effort, plant, sensor, state = at
    first, phase, image_s = ticks, state.phase, next_image_s(params.sensor, sensor)
    until = min(params.max_ticks, ticks + len(columns[0]) - ROWS_AT_ONCE - recorded)
    going, run = begin_run(exact, plant, effort)
    while going and ticks < until and ticks * dt_s < image_s:
        going, run = run_tick(exact, run, effort, dt_s)
        if not going:
            break
        t_s = ticks * dt_s
        measured = PlantReadings(run.motion, run.force_n, run.force_n)
        frame, sensor = read_frame(params.sensor, sensor, measured, t_s, dt_s, effort)
        command, state = control(params.controller, state, Reading(frame, pads, ()))
        effort = command.value
        row = recorded & NOT_NEGATIVE
        record(columns, row, frame, effort)
        phases[row] = state.phase | state.events << EVENT_SHIFT
        recorded, ticks = recorded + 1, ticks + 1
        going = state.phase == phase and state.done == 0 and state.guard.stopped == 0
    if ticks == first:
        return at, now
    plant = end_run(exact, plant, run, ticks - first)
    return LoopProgress(ticks, recorded, effort, plant, sensor, state), now
