"""Events that end a step: a contact, an end of the travel, a reversal, the release of the object, a contact after it.

The equation of motion changes at an event, so no step goes beyond it. The path of a Verlet step is known in advance,
and it ends at the event (`drift`). For a macro-step, `event_share` returns the fraction of it at which the event lies.
"""

from __future__ import annotations

from typing import Final

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import CONTACT_TOL_M
from graspsense_sim_gripper.plant.drive import ARREST_M_S
from graspsense_sim_gripper.plant.state import ContactState, Motion, right_of
from graspsense_sim_gripper.solve.control import contact_step_s
from graspsense_sim_gripper.solve.scheme import Attempt, PlantParams, Start, end_of_travel

NEWTON_ITERATIONS: Final = 4
"""Of the search for a contact on the parabola, begun from the secant."""
MIN_FRACTION: Final = 0.01
MAX_FRACTION: Final = 0.99
"""A repeated step is shorter by at least a hundredth, and no shorter than a hundredth."""


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
    """Return the fraction of a macro-step at which an event lies, by the secant; 0 if there is none."""
    revolutions, speed, gap, jacobian = start.motion
    revolutions1, speed1, gap1, jacobian1 = attempt.motion
    direction, meeting = start.direction, start.meeting_m
    end = end_of_travel(params.drive, direction)
    fraction = 0.0
    if gap > meeting and gap1 < meeting - CONTACT_TOL_M:
        fraction = (gap - meeting) / (gap - gap1)
    elif (revolutions1 - end) * direction * abs(jacobian) > CONTACT_TOL_M:
        fraction = (end - revolutions) / (revolutions1 - revolutions)
    elif speed1 * direction < 0.0 and speed != 0.0 and abs(speed1 * jacobian1) >= ARREST_M_S:
        fraction = abs(speed) / (abs(speed) + abs(speed1))
    return min(max(fraction, MIN_FRACTION), MAX_FRACTION) if fraction > 0.0 else 0.0


def parting(params: PlantParams, start: Start, attempt: Attempt) -> float:
    """Return the fraction of a step at which a finger leaves the object that it pressed, 0 if none does.

    Beyond the end of the recovering object nothing drives the fingers.
    """
    gap, gap1 = start.motion.gap_m, attempt.motion.gap_m
    if gap1 <= gap:
        return 0.0
    contact0, contact1 = start.contact, attempt.contact
    left = contact0.left.force_n > 0.0 and contact1.left.force_n == 0.0
    right = (
        right_of(contact0.left, contact0.right).force_n > 0.0
        and right_of(contact1.left, contact1.right).force_n == 0.0
    )
    if not (left or right):
        return 0.0
    model = params.object
    shift = 2.0 * contact1.offset_m if model.held == 1 else 0.0
    beyond = _gap_beyond(contact1.left, gap1 - model.width_m + shift) if left else 0.0
    if right:
        beyond = max(
            beyond, _gap_beyond(right_of(contact1.left, contact1.right), gap1 - model.width_m - shift)
        )
    if beyond <= CONTACT_TOL_M:
        return 0.0
    return min(max(1.0 - beyond / (gap1 - gap), MIN_FRACTION), MAX_FRACTION)


def pressing(params: PlantParams, start: Start, attempt: Attempt) -> float:
    """Return the fraction of a step at which a finger presses an object again that has not recovered its shape.

    0 if none does. A step that begins at this contact is the first after it, and no longer than that.
    """
    gap, gap1 = start.motion.gap_m, attempt.motion.gap_m
    contact0, contact1 = start.contact, attempt.contact
    if contact0.touched == 0 or gap1 >= gap:
        return 0.0
    right0, right1 = right_of(contact0.left, contact0.right), right_of(contact1.left, contact1.right)
    left = contact0.left.force_n <= 0.0 < contact1.left.force_n
    right = right0.force_n <= 0.0 < right1.force_n
    if not (left or right):
        return 0.0
    model, h = params.object, attempt.duration_s
    shift = 2.0 * contact0.offset_m if model.held == 1 else 0.0
    half = contact0.left if left else right0
    apart = _gap_beyond(half, gap - model.width_m + (shift if left else -shift))
    if apart <= CONTACT_TOL_M:
        first_s = contact_step_s(params.steps)
        return first_s / h if first_s < h else 0.0
    # The end of the object comes towards the finger as it recovers.
    closing = gap - gap1 - h * half.past.rate_m_s
    return min(max(apart / max(closing, apart), MIN_FRACTION), MAX_FRACTION)


def _gap_beyond(half: ContactState, opened_m: float) -> float:
    """Return by how much (m) the fingers have opened beyond the end of this half, when they are `opened_m` wider than
    the unloaded object."""
    return opened_m + half.compression_m + half.pad_m
