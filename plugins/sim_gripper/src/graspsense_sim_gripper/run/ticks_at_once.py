"""Ticks that are run at once: steps of the plant over several ticks, and the ticks of an approach.

Where the effort does not change, a step of the plant may last several ticks; the loop runs sensors and controller in
each of them.

In an approach the fingers close under a controller's law of free motion and meet nothing. In each of its ticks the
sensors are read and the law gives the command, as tick by tick, but the equation of motion is simplified: the friction
is linear in the speed, about that at the beginning, and the linkage is a cubic polynomial of the motor's angle. So a
tick is solved in a closed form, with the acceleration at its middle. The run ends where the speed has changed by more
than the linear friction allows, and at the end of the polynomial.
"""

from __future__ import annotations

import math
from typing import Any, Final, NamedTuple

from graspsense.gripper_api import gap_and_rate
from graspsense.plugin_api import Frame
from graspsense.simulator_api import CLOSES, FreeLimits, after_free, free_from, free_tick
from graspsense_sim_gripper.plant.contact import offset_of_pushed, with_forces_of
from graspsense_sim_gripper.plant.drive import STRIBECK_SPEEDS, stribeck_excess
from graspsense_sim_gripper.plant.sensing import SensorState, next_image_s, sense_motion
from graspsense_sim_gripper.plant.state import Contact, Motion
from graspsense_sim_gripper.run.loop import (
    NOT_NEGATIVE,
    ROWS_AT_ONCE,
    Ahead,
    GraspParams,
    LastTick,
    LoopProgress,
    MacroControl,
    Table,
    no_step,
)
from graspsense_sim_gripper.scene.terms.phi import phi_1_2
from graspsense_sim_gripper.solve.events import HALF
from graspsense_sim_gripper.solve.macro_step import (
    FIRST_TICKS,
    MAX_TICKS,
    MacroStep,
    constant_values,
    macro_step,
    next_ticks,
)
from graspsense_sim_gripper.solve.polynomial import Cubic, derivative, hermite, value
from graspsense_sim_gripper.solve.scheme import SPEED_SCALE_M_S, PlantState, StepState
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


MIN_TICKS: Final = 4
"""Fewest ticks of an approach that are run at once; the most are `ROWS_AT_ONCE`."""
LINKAGE_CHANGE: Final = 0.02
"""Largest relative change of the Jacobian of the linkage in a run. The gap of its polynomial is right to 10 nm then."""


class Approach(NamedTuple):
    """The constants of the motion in a run of ticks."""

    begin_rev: float
    per_rev: float
    """The fraction of the way is the motor's angle beyond `begin_rev`, times this."""
    gap_m: Cubic
    """The gap over the fraction of the way."""
    force_n: float
    """The force on the gap under which the speed would be constant, were it zero: load and friction."""
    resistance_n_s_m: float
    """Derivative of friction and damping with respect to the speed."""
    speed_gain: float
    """By how much a tick changes the motor's speed (rev/s) for each N m/rev of force on the gap times Jacobian."""
    angle_gain: float
    """The same for its angle (rev)."""
    speed_change_m_s: float
    """Change of the speed up to which the friction is linear to the tolerance."""


def approach_ticks(
    params: GraspParams, progress: LoopProgress, frame: Frame, columns: Table, phases: Any
) -> LoopProgress:
    """Run the ticks of an approach after that of `frame`; return where they end: at `progress` if there are none."""
    contact, motion = progress.plant.contact, progress.plant.motion
    if params.macro_steps != 1 or motion.speed_rev_s == 0.0 or not _closes_freely(params, contact, frame):
        return progress
    free, now = free_from(params.controller, progress.controller, frame)
    nearest = _nearest(params, contact)
    n = (
        _most_ticks(params, progress, max(nearest, free.limits.gap_m), free.limits)
        if free.kind == CLOSES
        else 0
    )
    if n < MIN_TICKS:
        return progress
    dt_s = params.dt_s
    way = _approach(params, motion, 0.5 * (contact.left_n + contact.right_n), n)
    shown, effort, i = progress.sensor.encoder, progress.tick.effort_n, 0
    first_m_s = motion.speed_rev_s * motion.jacobian_m_rev
    while i < n:
        t_s = (progress.tick.ticks + i) * dt_s
        next_shown = sense_motion(params.sensor, shown, motion, dt_s)
        gap_m, rate_m_s = next_shown.gap_m, next_shown.velocity_m_s
        command, next_now = free_tick(params.controller, free, now, t_s, dt_s, gap_m, rate_m_s)
        moved = _after_tick(way, motion, command, dt_s)
        change = abs(moved.speed_rev_s * moved.jacobian_m_rev - first_m_s)
        beyond = (moved.revolutions - way.begin_rev) * way.per_rev > 1.0
        # NaN too: the law says that free motion has ended.
        if not change <= way.speed_change_m_s or moved.gap_m <= nearest or beyond:
            break
        shown, now, motion = next_shown, next_now, moved
        row = (progress.tick.recorded + i) & NOT_NEGATIVE
        columns[0][row], columns[1][row], columns[2][row] = t_s, gap_m, rate_m_s
        columns[3][row], columns[8][row], phases[row] = effort, command, progress.controller.phase
        columns[4][row], columns[5][row] = frame.force_left_n, frame.force_right_n
        columns[6][row], columns[7][row] = frame.edge_left_n, frame.edge_right_n
        effort = command
        i += 1
    if i == 0:
        return progress
    state = after_free(
        params.controller, progress.controller, now, effort, (progress.tick.ticks + i - 1) * dt_s
    )
    gap, jacobian = gap_and_rate(params.plant.drive.link, motion.revolutions)
    _, _, (next_s, n_steps, unresolved), given, peak = progress.plant
    plant = PlantState(
        motion=Motion(motion.revolutions, motion.speed_rev_s, gap, jacobian),
        contact=_pushed(contact, gap - params.plant.object.width_m),
        step=StepState(next_s, n_steps + 1, unresolved),
        effort_n=given,
        peak_n=peak,
    )
    return LoopProgress(
        LastTick(progress.tick.ticks + i, progress.tick.recorded + i, effort),
        plant,
        SensorState(shown, progress.sensor.cells),
        state,
    )


def _closes_freely(params: GraspParams, contact: Contact, frame: Frame) -> bool:
    """Return whether the fingers touch nothing, or one of them pushes the object across the table."""
    if contact.touched == 0:
        return True
    left = contact.left
    shown = frame.force_left_n == contact.left_n and frame.force_right_n == contact.right_n
    pushes = contact.left_n + contact.right_n > 0.0 and left.force_n == 0.0 and left.compression_m == 0.0
    return pushes and params.plant.object.held == 0 and (shown or params.sensor.ideal == 0)


def _nearest(params: GraspParams, contact: Contact) -> float:
    """Return the gap at which the fingers meet the object, or press what one of them pushes."""
    width: float = max(params.plant.object.width_m, 0.0)
    return width + 2.0 * abs(contact.offset_m) if contact.touched == 0 else width


def _pushed(contact: Contact, space_m: float) -> Contact:
    """Return the contact of an object that a finger has pushed until the fingers are wider than it by this much."""
    if contact.touched == 0:
        return contact
    offset = offset_of_pushed(contact.offset_m, 0.5 * space_m)
    return with_forces_of(contact, offset, contact.pending_s)


def _most_ticks(params: GraspParams, progress: LoopProgress, nearest_m: float, limits: FreeLimits) -> int:
    """Return the number of ticks before the next image, and before the gap and the time at which the motion ends."""
    dt_s, motion = params.dt_s, progress.plant.motion
    closing = -motion.speed_rev_s * motion.jacobian_m_rev
    if closing <= 0.0:
        return 0
    t_s = progress.tick.ticks * dt_s
    left_s = min((motion.gap_m - nearest_m) / closing, limits.until_s - t_s, ROWS_AT_ONCE * dt_s)
    left_s = min(left_s, next_image_s(params.sensor, progress.sensor) - t_s)
    if left_s <= 0.0:
        return 0
    n: int = math.ceil(left_s / dt_s)
    return min(n, params.max_ticks - progress.tick.ticks)


def _approach(params: GraspParams, motion: Motion, load_n: float, n: int) -> Approach:
    """Return the constants of the motion over the next `n` ticks, with this mean force of the pads."""
    drive, dt_s = params.plant.drive, params.dt_s
    revolutions, speed, gap, jacobian = motion
    coulomb_n, _, stribeck, load_coefficient, damping = drive.friction
    velocity, way_rev = speed * jacobian, speed * n * dt_s
    gap1, jacobian1 = gap_and_rate(drive.link, revolutions + way_rev)
    if abs(jacobian1 - jacobian) > LINKAGE_CHANGE * abs(jacobian):
        way_rev *= LINKAGE_CHANGE * abs(jacobian / (jacobian1 - jacobian))
        gap1, jacobian1 = gap_and_rate(drive.link, revolutions + way_rev)
    excess, slope, curvature = stribeck_excess(drive.friction, velocity)
    resistance = damping - slope
    per_inertia = jacobian * jacobian / drive.inertia
    # The friction acts against the motion, which closes: its sign is that of opening.
    force = load_n + coulomb_n + load_coefficient * load_n + excess - slope * velocity
    change = abs(velocity) - STRIBECK_SPEEDS * stribeck
    if curvature != 0.0:
        allowed = params.plant.steps.macro_tolerance * max(abs(velocity), SPEED_SCALE_M_S)
        change = math.sqrt(2.0 * allowed / (per_inertia * abs(curvature) * n * dt_s))
    gain, gain2 = phi_1_2(resistance * per_inertia * dt_s)
    return Approach(
        begin_rev=revolutions,
        per_rev=1.0 / way_rev,
        gap_m=hermite(gap, gap1, way_rev * jacobian, way_rev * jacobian1),
        force_n=force,
        resistance_n_s_m=resistance,
        speed_gain=dt_s * gain / drive.inertia,
        angle_gain=dt_s * dt_s * gain2 / drive.inertia,
        speed_change_m_s=change,
    )


def _after_tick(way: Approach, motion: Motion, effort_n: float, dt_s: float) -> Motion:
    """Return the motion after a tick under this effort."""
    revolutions, speed, _, jacobian = motion
    begin, per_rev, gap, force, resistance, gain, gain2, _ = way
    # None of these waits for the effort, which a processor knows last. It changes the angle in a tick by little.
    way_rev = dt_s * speed
    coasted_rev = revolutions + way_rev
    s = (coasted_rev - begin) * per_rev
    jacobian1 = derivative(gap, s) * per_rev
    middle = jacobian + way_rev * (gap.c2 + 1.5 * gap.c3) * (per_rev * per_rev)
    push = middle * (force - resistance * speed * jacobian)
    by_speed, by_angle = gain * middle, gain2 * middle
    return Motion(
        (coasted_rev + gain2 * push) - by_angle * effort_n,
        (speed + gain * push) - by_speed * effort_n,
        (value(gap, s) + jacobian1 * (gain2 * push)) - (jacobian1 * by_angle) * effort_n,
        jacobian1,
    )
