"""Events that end a step: a contact, an end of the travel, a reversal, the release of the object, a contact after it.

The equation of motion changes at an event, so no step goes beyond it. An event is a quantity that passes zero in one
direction. How it is located depends on what is known of the path:

- The path of a Verlet step is known in advance, so it ends at the first three (`drift`).
- Of other paths both ends are known: the step is repeated up to where the secants through them say (`event_share`).
- An event of a term is the change of a whole number, which says nothing of how near it is. A step that contains one is
  repeated with half of its length. Where the motion of the fingers is given, bisection finds it (`until_event`).

When held fingers slip depends on forces alone (`stick`).
"""

from __future__ import annotations

from typing import Final

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import CONTACT_TOL_M, has_event, pad_forces, restarted
from graspsense_sim_gripper.plant.drive import ARREST_M_S
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.state import Contact, ContactState, Motion, right_of
from graspsense_sim_gripper.solve.control import MIN_STEP_S, contact_step_s
from graspsense_sim_gripper.solve.scheme import Attempt, PlantParams, Start, end_of_travel

NEWTON_ITERATIONS: Final = 4
"""Of the search for a contact on the parabola, begun from the secant."""
MIN_FRACTION: Final = 0.01
MAX_FRACTION: Final = 0.99
"""A repeated step is shorter by at least a hundredth, and no shorter than a hundredth."""
HALF: Final = 0.5
"""The share of a step after which an event is assumed that is only known to be in it."""


def drift(params: PlantParams, start: Start, h: float) -> tuple[Motion, float]:
    """Return the motion under constant acceleration after `h` or at an earlier event, and the time until then."""
    drive = params.drive
    revolutions, speed, gap, _ = start.motion
    rate, direction, meeting = start.acceleration, start.direction, start.meeting_m
    t = h
    if rate * direction < 0.0 and (speed + rate * h) * direction <= 0.0:
        t = -speed / rate
    revolutions1 = revolutions + t * (speed + 0.5 * rate * t)
    gap1, jacobian1 = gap_and_rate(drive.link, revolutions1)
    if gap > meeting > gap1:
        t = t * (gap - meeting) / (gap - gap1)
        for _ in range(NEWTON_ITERATIONS):
            revolutions1 = revolutions + t * (speed + 0.5 * rate * t)
            gap1, jacobian1 = gap_and_rate(drive.link, revolutions1)
            correction = (gap1 - meeting) / (jacobian1 * (speed + rate * t))
            if not 0.0 < t - correction <= h:
                break
            t -= correction
        gap1 = min(gap1, meeting)
    end = end_of_travel(drive, direction)
    if (revolutions1 - end) * direction > 0.0:
        # The object is compressed up to the end of the travel.
        t = min(max(t * (end - revolutions) / (revolutions1 - revolutions), 0.0), t)
        revolutions1 = end
        gap1, jacobian1 = gap_and_rate(drive.link, end)
    return Motion(revolutions1, speed + rate * t, gap1, jacobian1), t


def event_share(params: PlantParams, start: Start, attempt: Attempt) -> float:
    """Return the fraction of a step at which its first event lies, by the secant; 0 if there is none.

    Events of terms are not among them.
    """
    revolutions, speed, gap, jacobian = start.motion
    revolutions1, speed1, gap1, jacobian1 = attempt.motion
    contact, contact1 = start.contact, attempt.contact
    direction, meeting, model = start.direction, start.meeting_m, params.object
    end = end_of_travel(params.drive, direction)
    share = 1.0
    if gap > meeting and gap1 < meeting - CONTACT_TOL_M:
        share = min(share, _limited((gap - meeting) / (gap - gap1)))
    if (revolutions1 - end) * direction * abs(jacobian) > CONTACT_TOL_M:
        share = min(share, _limited((end - revolutions) / (revolutions1 - revolutions)))
    if speed1 * direction < 0.0 and speed != 0.0 and abs(speed1 * jacobian1) >= ARREST_M_S:
        share = min(share, _limited(abs(speed) / (abs(speed) + abs(speed1))))
    if contact.touched == 1 and gap1 != gap:
        shift = 2.0 * contact.offset_m if model.held == 1 else 0.0
        left, left1 = contact.left, contact1.left
        share = min(share, _share_of_half(params, start, attempt, left, left1, shift))
        if model.held == 1:
            right, right1 = right_of(left, contact.right), right_of(left1, contact1.right)
            share = min(share, _share_of_half(params, start, attempt, right, right1, -shift))
    return share if share < 1.0 else 0.0


def _limited(share: float) -> float:
    return min(max(share, MIN_FRACTION), MAX_FRACTION)


def _share_of_half(
    params: PlantParams,
    start: Start,
    attempt: Attempt,
    half: ContactState,
    half1: ContactState,
    shift_m: float,
) -> float:
    """Return the fraction of a step at which a finger leaves the object that it pressed, or presses it again.

    1 if it does neither. `shift_m`: by how much wider the fingers stand where the finger touches its half, as the
    object does not stand in the middle.
    """
    gap, gap1, width = start.motion.gap_m, attempt.motion.gap_m, params.object.width_m
    if gap1 > gap and half.force_n > 0.0 and half1.force_n == 0.0:
        # Beyond the end of the recovering object nothing drives the fingers.
        beyond = _gap_beyond(half1, gap1 - width + shift_m)
        if beyond > CONTACT_TOL_M:
            return _limited(1.0 - beyond / (gap1 - gap))
    if gap1 < gap and half.force_n <= 0.0 < half1.force_n:
        apart = _gap_beyond(half, gap - width + shift_m)
        if apart <= CONTACT_TOL_M:
            # A step that begins at this contact is the first after it, and no longer than that.
            return contact_step_s(params.steps) / attempt.duration_s
        # The end of an object that has not recovered its shape comes towards the finger as it recovers.
        closing = gap - gap1 - attempt.duration_s * half.past.rate_m_s
        return _limited(apart / max(closing, apart))
    return 1.0


def _gap_beyond(half: ContactState, opened_m: float) -> float:
    """Return by how much (m) the fingers have opened beyond the end of this half, when they are `opened_m` wider than
    the unloaded object."""
    return opened_m + half.compression_m + half.pad_m


def until_event(
    model: ObjectModel, contact: Contact, gap_m: float, speed_m_s: float, h: float, still: bool
) -> tuple[float, Contact]:
    """Return the time within `h` at which a term has its event, and the contact then.

    The fingers close from `gap_m` at this constant speed; `still`: it is 0. A compiler that knows it leaves much out.
    """
    lower, upper = 0.0, h
    while upper - lower > MIN_STEP_S:
        middle = 0.5 * (lower + upper)
        if has_event(
            contact, pad_forces(model, contact, gap_m - speed_m_s * middle, speed_m_s, middle, still)
        ):
            upper = middle
        else:
            lower = middle
    after = pad_forces(model, contact, gap_m - speed_m_s * upper, speed_m_s, upper, still)
    return upper, restarted(after)
