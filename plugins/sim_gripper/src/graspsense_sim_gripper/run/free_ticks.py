"""The ticks of free motion, one by one but without composing a reading and without supervision."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from graspsense.plugin_api import Frame
from graspsense.simulator_api import CALLED, TARING, after_free, free_from, free_tick
from graspsense_sim_gripper.plant.sensing import moved_sensor, next_image_s, sense_motion
from graspsense_sim_gripper.plant.state import Contact, Motion, PlantState
from graspsense_sim_gripper.run.approach import approach_ticks
from graspsense_sim_gripper.run.loop import (
    NOT_NEGATIVE,
    GraspParams,
    LoopProgress,
    Table,
)
from graspsense_sim_gripper.solve.coast import glided
from graspsense_sim_gripper.solve.scheme import PlantParams


def _cannot_glide(plant: PlantParams, state: PlantState, dt_s: float) -> bool:
    return False


def _never_glides(
    plant: PlantParams, motion: Motion, contact: Contact, effort_n: float, h: float
) -> tuple[bool, Motion, Contact]:
    return False, motion, contact


glide: Callable[[PlantParams, Motion, Contact, float, float], tuple[bool, Motion, Contact]] = _never_glides
"""`stepping.coast.glide`, where it does what `move` does in a tick of free motion."""
can_glide: Callable[[PlantParams, PlantState, float], bool] = _cannot_glide
"""`stepping.coast.can_glide`, likewise."""


def free_ticks(
    params: GraspParams, progress: LoopProgress, frame: Frame, columns: Table, phases: Any
) -> LoopProgress:
    """Run the ticks of free motion after that of `frame`, and return where they end: at `progress` if there are none.

    In these ticks no force changes, no cell image is taken or arrives, and the controller follows a law that needs
    neither (see `graspsense.core.control.free_motion`). What they give is what `grasp` gives tick by tick, to the bit.
    """
    free, now = free_from(params.controller, progress.controller, frame)
    if free.kind == CALLED or not _is_free(params, progress, frame):
        return progress
    dt_s, sensor, image_s = params.dt_s, params.sensor, next_image_s(params.sensor, progress.sensor)
    ticks, recorded, effort, plant = progress.ticks, progress.recorded, progress.effort_n, progress.plant
    shown = (progress.sensor.encoder_ticks, progress.sensor.gap_m, progress.sensor.velocity_m_s)
    phase, capacity, t_s, n_steps = progress.controller.phase, len(columns[0]), 0.0, 0
    motion, contact = plant.motion, plant.contact
    while ticks < params.max_ticks and recorded < capacity:
        next_t_s = ticks * dt_s
        if next_t_s >= image_s:
            break
        next_shown = sense_motion(sensor, shown, motion, dt_s)
        _, gap, velocity = next_shown
        command, next_now = free_tick(params.controller, free, now, next_t_s, dt_s, gap, velocity)
        if command != command:
            break
        glides, next_motion, next_contact = glide(params.plant, motion, contact, command, dt_s)
        if not glides:
            break
        if motion.speed_rev_s != 0.0:
            n_steps += 1
        t_s, shown, now, motion, contact = next_t_s, next_shown, next_now, next_motion, next_contact
        if phase > TARING:
            row = recorded & NOT_NEGATIVE
            columns[0][row], columns[1][row], columns[2][row] = t_s, gap, velocity
            columns[3][row], columns[8][row] = effort, command
            phases[row] = phase
            recorded += 1
        ticks += 1
        effort = command
    if ticks == progress.ticks:
        return progress
    for row in range(progress.recorded, recorded):
        columns[4][row], columns[5][row] = frame.force_left_n, frame.force_right_n
        columns[6][row], columns[7][row] = frame.edge_left_n, frame.edge_right_n
    plant = glided(plant, motion, contact, n_steps)
    state = after_free(params.controller, progress.controller, now, effort, t_s)
    return LoopProgress(ticks, recorded, effort, plant, moved_sensor(progress.sensor, shown), state)


def _is_free(params: GraspParams, progress: LoopProgress, frame: Frame) -> bool:
    """Return whether nothing is pressed, and the next frame shows the forces of this one unless an image arrives."""
    contact = progress.plant.contact
    same = frame.force_left_n == contact.left_n and frame.force_right_n == contact.right_n
    return (same or params.sensor.ideal == 0) and can_glide(params.plant, progress.plant, params.dt_s)


def approach_or_free_ticks(
    params: GraspParams, progress: LoopProgress, frame: Frame, columns: Table, phases: Any
) -> LoopProgress:
    """Run what compiled code does: `approach_ticks` where steps may last several ticks, otherwise `free_ticks`."""
    if params.macro_steps == 1:
        return approach_ticks(params, progress, frame, columns, phases)
    return free_ticks(params, progress, frame, columns, phases)
