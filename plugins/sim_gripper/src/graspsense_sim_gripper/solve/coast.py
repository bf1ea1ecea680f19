"""A tick in one step: motion without an event in which no object is compressed. Most ticks of a grasp are of this kind.

Nothing is touched; or a finger pushes the object across the table; or a released object recovers its shape, which no
sensor measures. The step is of third order in the speed: half of the acceleration's change is added, linearised in the
speed (friction, damping) and in the position (Jacobian of the linkage). Friction and linkage are then evaluated once
each, and neither waits for the other.
"""

from __future__ import annotations

from typing import Final

from graspsense.gripper_api import gap_and_rate
from graspsense_sim_gripper.plant.contact import offset_of_pushed, with_forces_of
from graspsense_sim_gripper.plant.drive import ARREST_M_S, is_held, stribeck_excess
from graspsense_sim_gripper.plant.object_model import ObjectModel
from graspsense_sim_gripper.plant.state import Contact, Motion, right_of
from graspsense_sim_gripper.solve.scheme import SPEED_SCALE_M_S, PlantParams, PlantState, StepState

SHAPE_SCALE_M: Final = 1e-3
"""The change of a released object's shape is relative to its compression, or to this where that is smaller."""


def coast(
    params: PlantParams, tolerance: float, state: PlantState, effort_n: float, h: float
) -> tuple[bool, PlantState]:
    """Return whether a tick of `h` is of this kind, and the plant after it.

    `tolerance`: its relative error, beyond which it is not.
    """
    coasts, motion, contact = _glide(params, tolerance, state.motion, state.contact, effort_n, h)
    if not coasts:
        return False, state
    _, _, (next_s, n_steps, unresolved), given, peak = state
    if state.motion.speed_rev_s != 0.0:
        n_steps += 1
    return True, PlantState(
        motion=motion,
        contact=contact,
        step=StepState(next_s, n_steps, unresolved),
        effort_n=given,
        peak_n=peak,
    )


def _glide(
    params: PlantParams, tolerance: float, motion: Motion, contact: Contact, effort_n: float, h: float
) -> tuple[bool, Motion, Contact]:
    """Return whether a tick of `h` is of this kind, or the fingers rest in it; and motion and contact after it.

    The forces on the pads do not change.
    """
    if motion.speed_rev_s == 0.0:
        return _rested(params, tolerance, motion, contact, effort_n, h)
    pending = 0.0
    reach = params.object.width_m + 2.0 * abs(contact.offset_m)
    if contact.touched == 1:
        coasts, reach, pending = _free_until(params, tolerance, contact, motion, h)
        if not coasts:
            return False, motion, contact
    load = 0.5 * (contact.left_n + contact.right_n)
    coasts, motion1 = _coasted(params, tolerance, motion, load, effort_n, h)
    if not coasts or motion1.gap_m <= reach:
        return False, motion, contact
    if contact.touched == 1:
        offset = contact.offset_m
        if load > 0.0:
            # The finger pushes the object towards the middle.
            offset = offset_of_pushed(offset, 0.5 * (motion1.gap_m - reach))
        contact = with_forces_of(contact, offset, pending)
    return True, motion1, contact


def _rested(
    params: PlantParams, tolerance: float, motion: Motion, contact: Contact, effort_n: float, h: float
) -> tuple[bool, Motion, Contact]:
    """Return what `_glide` does for fingers that stand still."""
    if not is_held(params.drive, motion, contact, effort_n):
        return False, motion, contact
    if contact.touched == 0:
        return True, motion, contact
    if contact.left_n + contact.right_n > 0.0:
        return False, motion, contact
    recovers, _, pending = _free_until(params, tolerance, contact, motion, h)
    return recovers, motion, with_forces_of(contact, contact.offset_m, pending)


def _free_until(
    params: PlantParams, tolerance: float, contact: Contact, motion: Motion, h: float
) -> tuple[bool, float, float]:
    """Return whether an object that was touched is not pressed, the gap down to which, and the time it is behind."""
    model: ObjectModel = params.object
    left, right, pending = contact.left, right_of(contact.left, contact.right), contact.pending_s
    if contact.left_n + contact.right_n > 0.0:
        pushed = not (
            left.force_n > 0.0 or left.compression_m != 0.0 or model.held == 1 or motion.speed_rev_s > 0.0
        )
        return pushed, model.width_m, pending
    reach = model.width_m + 2.0 * abs(contact.offset_m)
    pending += h
    change = pending * max(abs(left.past.rate_m_s), abs(right.past.rate_m_s))
    shape = max(abs(left.compression_m), abs(right.compression_m), SHAPE_SCALE_M)
    recovers = not (
        motion.gap_m <= reach
        or model.overshoots == 1
        or model.pads.damping_n_s_m > 0.0
        or model.pads.branch_n_m > 0.0
        or change * change > 2.0 * tolerance * shape * shape
    )
    return recovers, reach, pending


def _coasted(
    params: PlantParams, tolerance: float, motion: Motion, load_n: float, effort_n: float, h: float
) -> tuple[bool, Motion]:
    """Return whether the motion over `h` has no event of the drive and little error, and the motion after it."""
    # Fields by name would take the interpreter a third of the time of this function.
    link, inertia, friction, closed_rev, open_rev, _ = params.drive
    coulomb_n, _, _, load_coefficient, damping = friction
    revolutions, speed, _, jacobian = motion
    direction = 1.0 if speed > 0.0 else -1.0
    velocity = speed * jacobian
    excess, slope, curvature = stribeck_excess(friction, velocity)
    friction_n = coulomb_n + load_coefficient * load_n + excess
    net = load_n - effort_n - direction * friction_n
    net -= damping * velocity
    per_inertia = 1.0 / inertia
    rate = jacobian * per_inertia * net
    gained = h * rate
    # The linkage where the motion would end at constant speed; the rest of the path is linear.
    gap1, jacobian1 = gap_and_rate(link, revolutions + h * speed)
    bend = jacobian1 - jacobian
    resistance = direction * slope + damping
    change = per_inertia * (bend * (net - resistance * velocity) - jacobian * jacobian * resistance * gained)
    error = abs(change)
    if curvature != 0.0:
        # Where friction has its maximum its slope is zero, and yet it changes.
        gained_m_s = gained * jacobian
        error += abs(jacobian) * per_inertia * 0.5 * abs(curvature) * gained_m_s * gained_m_s
    gain = 0.5 * gained
    speed1 = speed + h * (rate + 0.5 * change)
    if (speed + gained) * direction <= 0.0 or abs(velocity) < ARREST_M_S:
        return False, motion
    revolutions1 = revolutions + h * (speed + gain)
    gap1 += h * gain * jacobian1
    jacobian1 += bend / speed * gain
    coasts = (
        speed1 * direction > 0.0
        and closed_rev < revolutions1 < open_rev
        and h * abs(jacobian) * error <= tolerance * SPEED_SCALE_M_S
    )
    return coasts, Motion(revolutions1, speed1, gap1, jacobian1)
