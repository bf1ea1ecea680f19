"""Macro-steps: one step of the plant over several ticks in which the effort is constant, with values at each tick.

A controller reads its sensors at every tick, but the motion between the ticks is usually smooth for much longer. Where
the effort does not change, the plant takes one step over several ticks, and polynomials give what the sensors read at
the ticks within it (dense output: Hairer, Norsett and Wanner, Solving Ordinary Differential Equations I, II.6). A
macro-step contains no event. Where it would, the plant is advanced tick by tick, which locates the event.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import has_event, pad_forces
from graspsense_sim_gripper.plant.drive import Drive, acceleration, is_held, sliding_friction
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.state import Contact, Motion, PlantReadings, right_of
from graspsense_sim_gripper.solve.advance import completed, rests
from graspsense_sim_gripper.solve.coast import coast
from graspsense_sim_gripper.solve.control import (
    MIN_FACTOR,
    SAFETY,
    SMALL_ERROR,
    relative_error,
)
from graspsense_sim_gripper.solve.events import HALF, event_share
from graspsense_sim_gripper.solve.polynomial import Cubic, derivative, hermite, parabola, value
from graspsense_sim_gripper.solve.scheme import (
    FORCE_SCALE_N,
    SPEED_SCALE_M_S,
    Attempt,
    PlantParams,
    PlantState,
    Start,
    Steps,
    StepState,
    comes_to_rest,
    start_of,
)
from graspsense_sim_gripper.solve.stick import stick
from graspsense_sim_gripper.solve.trend import (
    UNKNOWN,
    Trend,
    change_to_middle,
    errors,
    speed_for_end,
    trend_at_end,
)

FIRST_TICKS: Final = 2
"""Number of ticks in the first macro-step."""
MAX_TICKS: Final = 128
"""Largest number of ticks in a macro-step; no more than the rows that `loop.ROWS_AT_ONCE` keeps free."""
RELAXATION_ERROR: Final = 0.1
"""The error of a force that relaxes while the fingers are held, as a share of its second difference over the step."""
GROWTH: Final = 4.0
"""Largest ratio of successive macro-steps."""
EXPONENT: Final = -0.25
"""The error of a macro-step with a trend is proportional to the fourth power of its length."""


class DenseOutput(NamedTuple):
    """The motion and the forces of the pads within a macro-step, as polynomials of the fraction of it."""

    duration_s: float
    revolutions: Cubic
    gap_m: Cubic
    jacobian_m_rev: Cubic
    left_n: Cubic
    right_n: Cubic


class MacroStep(NamedTuple):
    """An attempted macro-step."""

    error: float
    """Its error relative to the tolerance: at most 1 if the step is accepted; inf if it would contain an event."""
    event_share: float
    """The share of its duration up to that event, as far as it is known."""
    after: PlantState
    values: DenseOutput
    """The values within it."""
    trend: Trend
    """That at its end."""


def macro_step(params: PlantParams, state: PlantState, effort_n: float, h: float, trend: Trend) -> MacroStep:
    """Return an attempted step of `h`. `trend`: that of the macro-step that ends here, under the same effort."""
    error, share, middle, after, later = math.inf, HALF, state.contact, state, UNKNOWN
    if state.motion.speed_rev_s == 0.0 and not _too_long(params, state, h):
        error, share, middle, after = _rested(params, state, effort_n, h)
    elif not _too_long(params, state, h):
        error, share, middle, after, later = _moved(params, state, effort_n, h, trend)
    return MacroStep(
        error=error, event_share=share, after=after, values=dense_output(state, middle, after, h), trend=later
    )


def _too_long(params: PlantParams, state: PlantState, h: float) -> bool:
    return state.contact.touched == 1 and h > params.steps.longest_touched_s


def _rested(
    params: PlantParams, state: PlantState, effort_n: float, h: float
) -> tuple[float, float, Contact, PlantState]:
    """Return what `_moved` does for a step in which the fingers are held."""
    contact = state.contact
    if not is_held(params.drive, state.motion, contact, effort_n):
        return math.inf, HALF, contact, state
    if rests(params.drive, state, effort_n):
        return 0.0, HALF, contact, state
    if contact.left.force_n <= 0.0 and contact.left_n + contact.right_n > 0.0:
        return math.inf, HALF, contact, state
    middle, t = stick(params, state, effort_n, 0.5 * h)
    after, t1 = stick(params, middle, effort_n, 0.5 * h)
    if t < 0.5 * h or t1 < 0.5 * h or _has_event(contact, after.contact):
        return math.inf, HALF, contact, state
    load, load1, load2 = _load(contact), _load(middle.contact), _load(after.contact)
    second_difference_n = abs(load - 2.0 * load1 + load2)
    return (
        RELAXATION_ERROR * second_difference_n / (params.steps.macro_tolerance * max(load, FORCE_SCALE_N)),
        HALF,
        middle.contact,
        after,
    )


def _moved(
    params: PlantParams, state: PlantState, effort_n: float, h: float, trend: Trend
) -> tuple[float, float, Contact, PlantState, Trend]:
    """Return error and event of a step of moving fingers (see `MacroStep`), the contact half-way, and the plant after.

    The last value is the trend then. The scheme is of Runge-Kutta-Nystrom type with the nodes 0, 1/2 and 1 and the
    weights of Simpson's rule; `trend` gives the middle, and the errors, more exactly. The third stage is at the end of
    the path, so that the object has two steps of `h` / 2.
    """
    drive, model, _ = params
    link, contact, motion = drive.link, state.contact, state.motion
    if contact.touched == 1 and contact.left.force_n <= 0.0:
        # A released object that recovers its shape, which is computed later, or one that a finger pushes.
        scale = max(abs(motion.speed_rev_s * motion.jacobian_m_rev) / SPEED_SCALE_M_S, 1.0)
        tolerance = scale * params.steps.macro_tolerance
        coasts, after = coast(params, tolerance, state, effort_n, h)
        if coasts or contact.left_n + contact.right_n > 0.0:
            return 0.0 if coasts else math.inf, HALF, contact, after, UNKNOWN
    start = start_of(params, state, effort_n)
    if comes_to_rest(start):
        return math.inf, HALF, contact, state, UNKNOWN
    revolutions, speed, _, jacobian = motion
    direction, rate = start.direction, start.acceleration
    change = change_to_middle(trend, h)
    mean = speed + 0.5 * h * (rate / 2.0 + change.linear / 6.0 + change.square / 12.0)
    gap1, jacobian1 = gap_and_rate(link, revolutions + 0.5 * h * mean)
    speed1 = speed + 0.5 * h * (rate + change.linear / 2.0 + change.square / 3.0)
    middle = pressed(model, contact, gap1, -speed1 * jacobian1, 0.5 * h)
    rate1 = acceleration_of(drive, jacobian1, speed1, middle, effort_n, direction)
    revolutions2 = revolutions + h * (speed + h * (rate + 2.0 * rate1) / 6.0)
    gap2, jacobian2 = gap_and_rate(link, revolutions2)
    speed2 = speed_for_end(trend, change, speed, rate, rate1, h)
    end = pressed(model, middle, gap2, -speed2 * jacobian2, 0.5 * h)
    rate2 = acceleration_of(drive, jacobian2, speed2, end, effort_n, direction)
    speed_end = speed + h * (rate + 4.0 * rate1 + rate2) / 6.0
    motion2, rates = Motion(revolutions2, speed_end, gap2, jacobian2), (rate, rate1, rate2)
    off = errors(trend, change, rates, h)
    attempt = Attempt(
        motion=motion2,
        contact=end,
        duration_s=h,
        speed_error_m_s=off.speed * abs(jacobian),
        force_error_n=force_error(start, motion2, end, off.angle),
    )
    share = _event_share(params, start, middle, attempt)
    if share > 0.0:
        return math.inf, share, contact, state, UNKNOWN
    next_s, n_steps, unresolved = state.step
    after = completed(params, state, motion2, end, StepState(next_s, n_steps + 1, unresolved), start.reach_m)
    error = relative_error(params.steps.macro_tolerance, start, attempt)
    return error, HALF, middle, after, trend_at_end(rates, h)


def pressed(model: ObjectModel, contact: Contact, gap_m: float, speed_m_s: float, h: float) -> Contact:
    """Return the contact at this gap, reached within `h` and closing at `speed_m_s`, where something is touched."""
    return pad_forces(model, contact, gap_m, speed_m_s, h, False) if contact.touched == 1 else contact


def acceleration_of(
    drive: Drive,
    jacobian_m_rev: float,
    speed_rev_s: float,
    contact: Contact,
    effort_n: float,
    direction: float,
) -> float:
    """Return the motor's acceleration (rev/s2) while it slides in this direction under the forces of the contact."""
    load = _load(contact)
    friction_n = sliding_friction(drive.friction, speed_rev_s * jacobian_m_rev, load)
    return acceleration(drive, jacobian_m_rev, speed_rev_s, load - effort_n, friction_n, direction)


def force_error(start: Start, motion1: Motion, contact1: Contact, position_error_rev: float) -> float:
    """Return the error of the force (N) that this error of the position causes, by the mean stiffness of the step."""
    way = abs(motion1.revolutions - start.motion.revolutions)
    change_n = abs(_load(contact1) - _load(start.contact))
    return change_n * abs(position_error_rev) / way if way > 0.0 else 0.0


def _event_share(params: PlantParams, start: Start, middle: Contact, attempt: Attempt) -> float:
    """Return the share of this step up to its first event, as far as it is known; 0 if there is none.

    The motion ends, a finger meets or leaves the object, or a term has an event. `middle` is the contact half-way.
    """
    contact0, contact1 = start.contact, attempt.contact
    if _has_event(contact0, middle) or _has_event(contact0, contact1):
        return HALF
    share = event_share(params, start, attempt)
    if share == 0.0 and (
        attempt.motion.speed_rev_s * start.direction <= 0.0
        or start.motion.gap_m > start.meeting_m >= attempt.motion.gap_m
        or not _pressed_halves(contact0) == _pressed_halves(middle) == _pressed_halves(contact1)
    ):
        share = HALF
    return share


def _pressed_halves(contact: Contact) -> tuple[bool, bool]:
    return contact.left.force_n > 0.0, right_of(contact.left, contact.right).force_n > 0.0


def _has_event(earlier: Contact, later: Contact) -> bool:
    return earlier.touched == 1 and has_event(earlier, later)


def _load(contact: Contact) -> float:
    return 0.5 * (contact.left_n + contact.right_n)


def next_ticks(n: int, error: float, event_share: float) -> int:
    """Return the number of ticks of the next macro-step after one of `n` ticks with this error and event.

    The same control as that of single steps (`control`), for the error of a scheme of fourth order.
    """
    if not error < math.inf:
        return min(int(n * event_share), n - 1)
    factor = GROWTH if error <= SMALL_ERROR else SAFETY * error**EXPONENT
    return min(max(int(n * min(max(factor, MIN_FACTOR), GROWTH)), 1), MAX_TICKS)


def dense_output(state0: PlantState, middle: Contact, state1: PlantState, h: float) -> DenseOutput:
    """Return the polynomials between two states; `middle` is the contact after half of the time."""
    revolutions, speed, gap, jacobian = state0.motion
    revolutions1, speed1, gap1, jacobian1 = state1.motion
    contact, contact1 = state0.contact, state1.contact
    return DenseOutput(
        duration_s=h,
        revolutions=hermite(revolutions, revolutions1, h * speed, h * speed1),
        gap_m=hermite(gap, gap1, h * speed * jacobian, h * speed1 * jacobian1),
        jacobian_m_rev=Cubic(jacobian, jacobian1 - jacobian, 0.0, 0.0),
        left_n=parabola(contact.left_n, middle.left_n, contact1.left_n),
        right_n=parabola(contact.right_n, middle.right_n, contact1.right_n),
    )


def constant_values(state: PlantState) -> DenseOutput:
    """Return the values of a state that does not change."""
    return dense_output(state, state.contact, state, 1.0)


def with_peak(state: PlantState, peak_n: float) -> PlantState:
    """Return the same state, in which the largest force on a pad so far was at least this."""
    peak_n = max(state.peak_n, peak_n)
    return PlantState(
        motion=state.motion, contact=state.contact, step=state.step, effort_n=state.effort_n, peak_n=peak_n
    )


def held_at_once(model: PlantParams, plant: PlantState) -> PlantParams:
    """Return the model in which fingers at rest are held in one step. A macro-step showed how little relaxes."""
    drive, body, (tolerance, longest_s, settle, growth, touched_s, macro_tolerance) = model
    if plant.motion.speed_rev_s == 0.0:
        longest_s = math.inf
    return PlantParams(
        drive,
        body,
        Steps(
            tolerance=tolerance,
            longest_s=longest_s,
            settle=settle,
            growth=growth,
            longest_touched_s=touched_s,
            macro_tolerance=macro_tolerance,
        ),
    )


def values_at(dense: DenseOutput, s: float) -> PlantReadings:
    """Return what the sensors measure at this fraction of the macro-step."""
    h, revolutions, gap, jacobian, left, right = dense
    speed = derivative(revolutions, s) / h
    motion = Motion(value(revolutions, s), speed, value(gap, s), value(jacobian, s))
    return PlantReadings(motion, value(left, s), value(right, s))
