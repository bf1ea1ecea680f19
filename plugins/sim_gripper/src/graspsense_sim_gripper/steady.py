"""A steady approach: the ticks in which the fingers close at a constant speed and touch nothing, run at once.

The controller holds the speed at which its command balances friction and the inertia of the linkage. A Newton step from
the present speed gives it. Where both differ by a small share only, the fingers are taken to move at that speed, up to
the next cell image, and up to 0.1 s before the contact, within which deviations decay. In each of these ticks the
sensors are read and the controller's law of free motion gives the command, but what the noise of the encoder in this
command does to the motion is neglected.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final

from graspsense.plugin_api import (
    CLOSES,
    Frame,
    FreeLimits,
    after_free,
    free_from,
    gap_and_rate,
)
from graspsense_sim_gripper.dynamics.contact import offset_of_pushed
from graspsense_sim_gripper.dynamics.drive import Drive, acceleration, sliding_friction
from graspsense_sim_gripper.dynamics.state import Contact, Motion, PlantState, StepState
from graspsense_sim_gripper.loop import NOT_NEGATIVE, ROWS_AT_ONCE, GraspParams, LoopProgress, Table
from graspsense_sim_gripper.sensing import moved_sensor, next_image_s, sense_motion

MIN_TICKS: Final = 4
MAX_TICKS: Final = ROWS_AT_ONCE
"""Fewest and most ticks that are run at once."""
SETTLING_S: Final = 0.1
"""Time before the contact, or before another limit of the motion, that is run tick by tick."""
ENCODER_SPEED_RTOL: Final = 2e-3
"""Largest relative difference of the present speed from the steady one where an encoder is read: somewhat more than its
ticks cause. With ideal sensors it is the tolerance of macro-steps."""
DRIFT_RTOL: Final = 1e-4
"""Relative change of the steady speed over these ticks that is allowed in any case: it moves the fingers by less than a
hundredth of the way of a tick."""
CURVATURE_REV: Final = 1e-3
"""Angle over which the curvature of the linkage is computed."""
NEWTON_ITERATIONS: Final = 2
"""Of the search for the angle at which the linkage has a gap."""
DIFFERENCE: Final = 1e-3
"""Relative difference of the two speeds from which the Newton step is computed."""


def _no_command(
    params: Any, memory: Any, gap_m: float, velocity_m_s: float, dt_s: float
) -> tuple[float, Any]:
    return math.nan, memory


free_command: Callable[[Any, Any, float, float, float], tuple[float, Any]] = _no_command


def steady_ticks(
    params: GraspParams, at: LoopProgress, frame: Frame, columns: Table, phases: Any
) -> LoopProgress:
    """Run the ticks of a steady approach after that of `frame`; return where they end: at `at` if there are none."""
    contact, motion = at.plant.contact, at.plant.motion
    if params.macro_steps == 0 or motion.speed_rev_s == 0.0 or not _closes_freely(params, contact, frame):
        return at
    free, (memory, still) = free_from(params.controller, at.controller, frame)
    n = _most_ticks(params, at, free.limits) if free.kind == CLOSES else 0
    if n < MIN_TICKS:
        return at
    drive, dt_s = params.plant.drive, params.dt_s
    load_n = 0.5 * (contact.left_n + contact.right_n)
    speed, change = _steady_speed(params, motion, load_n, memory)
    rtol = params.plant.steps.macro_tolerance
    if params.sensor.ideal == 0:
        rtol = max(rtol, ENCODER_SPEED_RTOL)
    if not abs(change) <= rtol * abs(speed):
        return at
    end = _at_constant_speed(drive, motion, speed, n * dt_s)
    readings = at.sensor.encoder_ticks, at.sensor.gap_m, at.sensor.velocity_m_s
    effort = at.effort_n
    for i in range(n):
        readings = sense_motion(params.sensor, readings, _between(motion, end, speed, i / n), dt_s)
        row = (at.recorded + i) & NOT_NEGATIVE
        columns[0][row], columns[1][row], columns[2][row] = (at.ticks + i) * dt_s, readings[1], readings[2]
        columns[3][row] = effort
        effort, memory = free_command(params.controller.law, memory, readings[1], readings[2], dt_s)
        columns[4][row], columns[5][row] = frame.force_left_n, frame.force_right_n
        columns[6][row], columns[7][row] = frame.edge_left_n, frame.edge_right_n
        columns[8][row], phases[row] = effort, at.controller.phase
        # NaN too: the law says that free motion has ended.
        if not (abs(effort) <= free.effort_limit_n and abs(readings[2]) <= free.speed_limit_m_s):
            return at
    _, change = _steady_speed(params, end, load_n, memory)
    if not abs(change) <= max(rtol, DRIFT_RTOL) * abs(speed):
        return at
    t_s = (at.ticks + n - 1) * dt_s
    state = after_free(params.controller, at.controller, (memory, still), effort, t_s)
    _, _, (next_s, n_steps, unresolved), given, peak = at.plant
    contact = _pushed(contact, end.gap_m - params.plant.object.width_m)
    plant = PlantState(end, contact, StepState(next_s, n_steps + 1, unresolved), given, peak)
    sensor = moved_sensor(at.sensor, readings)
    return LoopProgress(at.ticks + n, at.recorded + n, effort, plant, sensor, state)


def _closes_freely(params: GraspParams, contact: Contact, frame: Frame) -> bool:
    """Return whether the fingers touch nothing, or one of them pushes the object across the table."""
    if contact.touched == 0:
        return True
    left = contact.left
    shown = frame.force_left_n == contact.left_n and frame.force_right_n == contact.right_n
    pushes = contact.left_n + contact.right_n > 0.0 and left.force_n == 0.0 and left.compression_m == 0.0
    return pushes and params.plant.object.held == 0 and (shown or params.sensor.ideal == 0)


def _pushed(contact: Contact, space_m: float) -> Contact:
    """Return the contact of an object that a finger has pushed until the fingers are wider than it by this much."""
    left_n, right_n, offset, touched, left, right, pending, unbalanced = contact
    if touched == 0:
        return contact
    offset = offset_of_pushed(offset, 0.5 * space_m)
    return Contact(left_n, right_n, offset, touched, left, right, pending, unbalanced)


def _most_ticks(params: GraspParams, at: LoopProgress, limits: FreeLimits) -> int:
    """Return the number of ticks before the next image, and well before the contact and the limits."""
    dt_s, motion, contact = params.dt_s, at.plant.motion, at.plant.contact
    closing = -motion.speed_rev_s * motion.jacobian_m_rev
    if closing <= 0.0:
        return 0
    t_s = at.ticks * dt_s
    nearest = max(params.plant.object.width_m, 0.0)
    if contact.touched == 0:
        nearest += 2.0 * abs(contact.offset_m)
    nearest = max(nearest, limits.gap_m)
    left_s = min((motion.gap_m - nearest) / closing, limits.until_s - t_s) - SETTLING_S
    left_s = min(left_s, MAX_TICKS * dt_s, next_image_s(params.sensor, at.sensor) - t_s)
    if left_s <= 0.0:
        return 0
    n: int = math.ceil(left_s / dt_s)
    return min(n, params.max_ticks - at.ticks)


def _steady_speed(params: GraspParams, motion: Motion, load_n: float, memory: Any) -> tuple[float, float]:
    """Return the steady speed of the gap (m/s), and by how much it differs from the present one; inf if none is near.

    At that speed the command of the controller, which reads it exactly, does not accelerate the fingers.
    """
    drive, law, dt_s = params.plant.drive, params.controller.law, params.dt_s
    _, speed_rev, gap, jacobian = motion
    speed = speed_rev * jacobian
    other = speed * (1.0 + DIFFERENCE)
    effort, _ = free_command(law, memory, gap, speed, dt_s)
    effort1, _ = free_command(law, memory, gap, other, dt_s)
    rate = _gap_rate(drive, motion, load_n, speed, effort)
    slope = (_gap_rate(drive, motion, load_n, other, effort1) - rate) / (other - speed)
    if not slope < 0.0:
        return speed, math.inf
    return speed - rate / slope, -rate / slope


def _gap_rate(drive: Drive, motion: Motion, load_n: float, speed_m_s: float, effort_n: float) -> float:
    """Return the acceleration of the gap (m/s2) at this speed under this effort."""
    revolutions, _, _, jacobian = motion
    speed_rev = speed_m_s / jacobian
    _, jacobian1 = gap_and_rate(drive.link, revolutions + CURVATURE_REV)
    friction_n = sliding_friction(drive.friction, speed_m_s, load_n)
    rate = acceleration(drive, jacobian, speed_rev, load_n - effort_n, friction_n, -1.0)
    return jacobian * rate + (jacobian1 - jacobian) / CURVATURE_REV * speed_rev * speed_rev


def _between(start: Motion, end: Motion, speed_m_s: float, s: float) -> Motion:
    """Return the motion at this fraction of a way at a constant speed of the gap."""
    travel = end.revolutions - start.revolutions
    at_first = (end.gap_m - start.gap_m) / start.jacobian_m_rev
    jacobian = start.jacobian_m_rev + s * (end.jacobian_m_rev - start.jacobian_m_rev)
    revolutions = start.revolutions + s * (travel + (s - 1.0) * (travel - at_first))
    gap = start.gap_m + s * (end.gap_m - start.gap_m)
    return Motion(revolutions, speed_m_s / jacobian, gap, jacobian)


def _at_constant_speed(drive: Drive, motion: Motion, speed_m_s: float, h: float) -> Motion:
    """Return the motion after the gap has changed for `h` at this speed."""
    gap = motion.gap_m + speed_m_s * h
    revolutions = motion.revolutions + speed_m_s * h / motion.jacobian_m_rev
    for _ in range(NEWTON_ITERATIONS):
        gap1, jacobian1 = gap_and_rate(drive.link, revolutions)
        revolutions -= (gap1 - gap) / jacobian1
    gap1, jacobian1 = gap_and_rate(drive.link, revolutions)
    return Motion(revolutions, speed_m_s / jacobian1, gap1, jacobian1)
