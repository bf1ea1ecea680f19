"""The plant over a tick: the loop over its steps."""

from __future__ import annotations

import math
from typing import Final

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import has_event, is_pressed, is_touched, restarted
from graspsense_sim_gripper.plant.drive import Drive, is_held
from graspsense_sim_gripper.plant.state import Contact, Motion, PlantState, StepState
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
from graspsense_sim_gripper.solve.events import parting, pressing
from graspsense_sim_gripper.solve.scheme import (
    Attempt,
    PlantParams,
    Start,
    comes_to_rest,
    start_of,
)
from graspsense_sim_gripper.solve.stick import stick
from graspsense_sim_gripper.solve.verlet import verlet

LAG_PIECES: Final = 4.0
LAG_SHARE: Final = 0.25
MAX_LAG_PIECES: Final = 1000
"""Pieces per time constant in which the force of a drive that lags is constant: at least the first number, or the
second over the cube root of the tolerance, since their error is of second order. The third is the most in a tick."""
BISECTION: Final = 0.5
"""A step that contains an event of a term is repeated with this share of its length, until it is `MIN_STEP_S` long."""
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
            state = PlantState(motion, contact, step, effort_n + difference * decay, peak)
        state = advance(params, state, mean, h)
    return state


def advance(params: PlantParams, state: PlantState, effort_n: float, dt: float) -> PlantState:
    """Return the plant after `dt` under a constant force."""
    if state.motion.speed_rev_s == 0.0 and rests(params.drive, state, effort_n):
        return state
    if fits_a_step(params.steps, state.step, dt):
        coasts, after = coast(params, state, effort_n, dt)
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
        attempt = _standing(start)
        after_step = StepState(step.next_s, step.n_steps + 1, step.unresolved)
    else:
        attempt = verlet(params, start, effort_n, h)
        changes = contact.touched == 1 and has_event(contact, attempt.contact)
        duration = attempt.duration_s
        if duration > MIN_STEP_S and not forced:
            fraction = BISECTION
            if not changes:
                # The step ends at the other events by itself.
                fraction = parting(params, start, attempt)
                if fraction == 0.0:
                    fraction = pressing(params, start, attempt)
            if fraction > 0.0:
                retry = StepState(duration * fraction, step.n_steps, step.unresolved)
                return PlantState(state.motion, contact, retry, state.effort_n, state.peak_n), 0.0
        attempt = _without_reversal(start, attempt)
        # A step across an event of a term has an error only where the force jumps, and none that shorter steps reduce.
        error = 0.0 if changes else relative_error(steps.tolerance, start, attempt)
        growth = steps.growth
        if not is_pressed(attempt.contact):
            growth = FREE_GROWTH if steps.tolerance < math.inf else math.inf
        accepted, after_step = accept(error, attempt.duration_s, step, growth, forced)
        if not accepted:
            return PlantState(state.motion, contact, after_step, state.effort_n, state.peak_n), 0.0
        meets = state.motion.gap_m > start.meeting_m >= attempt.motion.gap_m
        if (changes or meets) and steps.growth < math.inf:
            after_step = after_contact(steps, after_step)
        elif changes:
            # The force is still that of the law before the event; a step this short takes over the one after it.
            after_step = StepState(MIN_CONTACT_STEP_S, after_step.n_steps, after_step.unresolved)
        if changes:
            attempt = _after_event(attempt)
    return completed(params, state, start, attempt, after_step), attempt.duration_s


def _after_event(attempt: Attempt) -> Attempt:
    """Return the attempt for the steps after an event of a term."""
    motion, contact, duration, speed_error, force_error = attempt
    return Attempt(motion, restarted(contact), duration, speed_error, force_error)


def rests(drive: Drive, state: PlantState, effort_n: float) -> bool:
    """Return whether fingers at rest remain so, with nothing that relaxes between them."""
    return state.contact.touched == 0 and is_held(drive, state.motion, state.contact, effort_n)


def _standing(start: Start) -> Attempt:
    """Return an attempt of no duration: the start of the step, at rest."""
    revolutions, _, gap, jacobian = start.motion
    return Attempt(Motion(revolutions, 0.0, gap, jacobian), start.contact, 0.0, 0.0, 0.0)


def _without_reversal(start: Start, attempt: Attempt) -> Attempt:
    """Return the attempt with speed zero if the motion has reversed, because friction changes its sign there."""
    revolutions, speed, gap, jacobian = attempt.motion
    if speed * start.direction > 0.0:
        return attempt
    motion = Motion(revolutions, 0.0, gap, jacobian)
    return Attempt(
        motion, attempt.contact, attempt.duration_s, attempt.speed_error_m_s, attempt.force_error_n
    )


def completed(
    params: PlantParams, state: PlantState, start: Start, attempt: Attempt, step: StepState
) -> PlantState:
    """Return the plant after an accepted step, with the contact, the peak and the ends of travel brought up to date."""
    drive, peak = params.drive, state.peak_n
    motion, contact = attempt.motion, attempt.contact
    revolutions, speed, gap, _ = motion
    left, right, touched = contact.left, contact.right, contact.touched
    if touched == 1 or gap <= start.reach_m:
        touched = is_touched(contact, gap, start.reach_m)
        peak = max(peak, contact.left_n, contact.right_n)
    if touched != contact.touched:
        left_n, right_n, offset, _, _, _, pending, unbalanced = contact
        contact = Contact(left_n, right_n, offset, touched, left, right, pending, unbalanced)
    if (revolutions >= drive.open_rev and speed >= 0.0) or (revolutions <= drive.closed_rev and speed <= 0.0):
        end = drive.open_rev if revolutions >= drive.open_rev else drive.closed_rev
        gap, jacobian = gap_and_rate(drive.link, end)
        motion = Motion(end, 0.0, gap, jacobian)
    return PlantState(motion, contact, step, state.effort_n, peak)
