"""The ticks of an exactly discretised plant in one mode, run at once: in each the sensors, the controller and the plant."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from graspsense.plugin_api import Command, Pads, Reading, TickParams, TickState
from graspsense_sim_gripper.dynamics.state import PlantReadings
from graspsense_sim_gripper.exact.run import NO_RUN, begin_run, end_run, run_tick
from graspsense_sim_gripper.loop import (
    EVENT_SHIFT,
    NOT_NEGATIVE,
    ROWS_AT_ONCE,
    GraspParams,
    LoopProgress,
    Table,
    control_unbound,
    record,
)
from graspsense_sim_gripper.sensing import next_image_s, read_frame

control: Callable[[TickParams, TickState, Reading], tuple[Command, TickState]] = control_unbound


def exact_ticks(
    params: GraspParams, at: LoopProgress, pads: Pads, columns: Table, phases: Any
) -> LoopProgress:
    """Run ticks until an event may be within the next one, an image is due, or the phase changes; return the grasp then.

    `at` and the result are in a tick, after the controller and before the plant moves. `pads` is the last cell image.
    """
    dt_s, exact = params.dt_s, params.plant
    ticks, recorded, effort, plant, sensor, state = at
    image_s, phase, begun = next_image_s(params.sensor, sensor), state.phase, ticks
    most = min(params.max_ticks, ticks + len(columns[0]) - ROWS_AT_ONCE - recorded)
    run = begin_run(exact, plant, effort)
    # TODO
    while run.index != NO_RUN and ticks < most and ticks * dt_s < image_s:
        quiet, run = run_tick(exact, run, effort, dt_s)
        if not quiet:
            break
        measured = PlantReadings(run.motion, run.force_n, run.force_n)
        frame, sensor = read_frame(params.sensor, sensor, measured, ticks * dt_s, dt_s, effort)
        command, state = control(params.controller, state, Reading(frame, pads, ()))
        effort = command.value
        row = recorded & NOT_NEGATIVE
        record(columns, row, frame, effort)
        phases[row] = state.phase | state.events << EVENT_SHIFT
        recorded, ticks = recorded + 1, ticks + 1
        if state.phase != phase or state.done == 1 or state.guard.stopped == 1:
            break
    if ticks == begun:
        return at
    return LoopProgress(ticks, recorded, effort, end_run(exact, plant, run, ticks - begun), sensor, state)
