"""The plant over a tick: the loop over its steps."""

from __future__ import annotations

import math
from typing import Final

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import has_event, is_pressed, restarted, with_touch
from graspsense_sim_gripper.plant.drive import Drive, is_held
from graspsense_sim_gripper.plant.state import Contact, Motion
from graspsense_sim_gripper.scene.terms.phi import phi1
from graspsense_sim_gripper.solve.coast import coast
from graspsense_sim_gripper.solve.control import (
    FREE_GROWTH,
    MAX_STEPS,
    MIN_CONTACT_STEP_S,
    MIN_STEP_S,
    accept,
    after_contact,
    fits_a_step,
    next_length,
    relative_error,
)
from graspsense_sim_gripper.solve.events import HALF, event_share
from graspsense_sim_gripper.solve.scheme import (
    PlantParams,
    PlantState,
    StepState,
    comes_to_rest,
    start_of,
    with_step,
)
from graspsense_sim_gripper.solve.stick import stick
from graspsense_sim_gripper.solve.verlet import verlet

LAG_PIECES: Final = 4.0
LAG_SHARE: Final = 0.25
MAX_LAG_PIECES: Final = 1000
"""Pieces per time constant in which the force of a drive that lags is constant: at least the first number, or the
second over the cube root of the tolerance, since their error is of second order. The third is the most in a tick."""
REST_SHARE: Final = 1e-12
"""Fraction of the tick below which what is left of it is rounding."""


def move(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` in which this force was commanded (N, positive squeezes)."""
    lag = params.drive.lag_s
    n_pieces, h, mean = 1, dt, effort_n
    if lag > 0.0:
        per_lag = max(LAG_PIECES, LAG_SHARE * params.steps.tolerance ** (-1.0 / 3.0))
        n_pieces = max(math.ceil(min(per_lag * dt / lag, MAX_LAG_PIECES)), 1)
        h = dt / n_pieces
    for _ in range(n_pieces):
        if lag > 0.0:
            # The exact first-order response; each piece has its mean.
            decay, difference = math.exp(-h / lag), state.effort_n - effort_n
            mean = effort_n + difference * phi1(h / lag, decay)
            motion, contact, step, _, peak = state
            state = PlantState(
                motion=motion, contact=contact, step=step, effort_n=effort_n + difference * decay, peak_n=peak
            )
        state = advance(params, state, mean, h)
    return state


def advance(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` under a constant force."""
    if state.motion.speed_rev_s == 0.0 and rests(params.drive, state, effort_n):
        return state
    if fits_a_step(params.steps, state.step, dt):
        coasts, after = coast(params, params.steps.tolerance, state, effort_n, dt)
        if coasts:
            return after
    after, _ = take_steps(params, state, effort_n, dt)
    return after


def take_steps(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> tuple[PlantState, int]:
    """Return the plant after `dt` under a constant force, and the number of attempted steps."""
    left, n = dt, 0
    while True:
        h, forced = next_length(params.steps, state.step, left, n, state.contact.touched)
        state, used = take_step(params, state, effort_n, h, left, forced)
        left -= used
        n += 1
        if not (left > REST_SHARE * dt and n <= MAX_STEPS):
            return state, n


def take_step(
    params: PlantParams, state: PlantState, effort_n: float, h: float, left_s: float, forced: bool
) -> tuple[PlantState, float]:
    """Return the plant after an attempted step of `h`, and its duration: 0 if it was rejected.

    If the fingers stand still, the step is as long as possible, usually the rest of the tick. `forced`: the step
    is accepted whatever its error.
    """
    drive, _, steps = params
    contact, step = state.contact, state.step
    if state.motion.speed_rev_s == 0.0 and is_held(drive, state.motion, contact, effort_n):
        if contact.touched == 0:
            return state, left_s
        return stick(
            params,
            state,
            effort_n,
            left_s if forced else min(left_s, steps.longest_s, steps.longest_touched_s),
        )
    start = start_of(params, state, effort_n)
    if comes_to_rest(start):
        motion1, contact1, duration = stopped(start.motion), contact, 0.0
        after_step = StepState(step.next_s, step.n_steps + 1, step.unresolved)
    else:
        attempt = verlet(params, start, effort_n, h)
        motion1, contact1, duration = attempt.motion, attempt.contact, attempt.duration_s
        changes = contact.touched == 1 and has_event(contact, contact1)
        if duration > MIN_STEP_S and not forced:
            fraction = HALF if changes else event_share(params, start, attempt)
            if fraction > 0.0:
                return with_step(state, StepState(duration * fraction, step.n_steps, step.unresolved)), 0.0
        # A step across an event of a term has an error only where the force jumps, and none that shorter steps reduce.
        error = 0.0 if changes else relative_error(steps.tolerance, start, attempt)
        growth = steps.growth
        if not is_pressed(contact1):
            growth = FREE_GROWTH if steps.tolerance < math.inf else math.inf
        accepted, after_step = accept(error, duration, step, growth, forced)
        if not accepted:
            return with_step(state, after_step), 0.0
        meets = state.motion.gap_m > start.meeting_m >= motion1.gap_m
        if (changes or meets) and steps.growth < math.inf:
            after_step = after_contact(steps, after_step)
        elif changes:
            # The force is still that of the law before the event; a step this short takes over the one after it.
            after_step = StepState(MIN_CONTACT_STEP_S, after_step.n_steps, after_step.unresolved)
        if changes:
            contact1 = restarted(contact1)
    return completed(params, state, motion1, contact1, after_step, start.reach_m), duration


def rests(drive: Drive, state: PlantState, effort_n: float) -> bool:
    """Return whether fingers at rest remain so, with nothing that relaxes between them."""
    return state.contact.touched == 0 and is_held(drive, state.motion, state.contact, effort_n)


def stopped(motion: Motion) -> Motion:
    """Return the same position, at rest."""
    return Motion(motion.revolutions, 0.0, motion.gap_m, motion.jacobian_m_rev)


def completed(
    params: PlantParams, state: PlantState, motion: Motion, contact: Contact, step: StepState, reach_m: float
) -> PlantState:
    """Return the plant after a step from `state`, with the contact, the peak and the ends of travel brought up to date.

    `reach_m`: the gap at which the nearer finger touched the object before the step.
    """
    drive, peak = params.drive, state.peak_n
    revolutions, speed, gap, _ = motion
    if contact.touched == 1 or gap <= reach_m:
        contact = with_touch(contact, gap, reach_m)
        peak = max(peak, contact.left_n, contact.right_n)
    if (revolutions >= drive.open_rev and speed >= 0.0) or (revolutions <= drive.closed_rev and speed <= 0.0):
        end = drive.open_rev if revolutions >= drive.open_rev else drive.closed_rev
        gap, jacobian = gap_and_rate(drive.link, end)
        motion = Motion(end, 0.0, gap, jacobian)
    return PlantState(motion=motion, contact=contact, step=step, effort_n=state.effort_n, peak_n=peak)
