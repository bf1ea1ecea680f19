"""A tick in one step: motion without an event in which no object is compressed. Most ticks of a grasp are of this kind.

Nothing is touched; or a finger pushes the object across the table; or a released object recovers its shape, which no
sensor measures. The step is of third order in the speed: half of the acceleration's change is added, linearised in the
speed (friction, damping) and in the position (Jacobian of the linkage). Friction and linkage are then evaluated once
each, and neither waits for the other.
"""

from __future__ import annotations

from typing import Final

from graspsense.plugin_api import gap_and_rate
from graspsense_sim_gripper.dynamics.contact import ObjectModel
from graspsense_sim_gripper.dynamics.drive import ARREST_M_S, stribeck_excess
from graspsense_sim_gripper.dynamics.state import Contact, Motion, PlantState, StepState
from graspsense_sim_gripper.stepping.scheme import SPEED_SCALE_M_S, PlantParams

SHAPE_SCALE_M: Final = 1e-3
"""The change of a released object's shape is relative to its compression, or to this where that is smaller."""


def coast(params: PlantParams, state: PlantState, effort_n: float, h: float) -> tuple[bool, PlantState]:
    """Return whether a tick of `h` is of this kind, and the plant after it."""
    motion, contact, step, given, peak = state
    reach, pending = params.object.width_m + 2.0 * abs(contact.offset_m), contact.pending_s
    if contact.touched == 1:
        coasts, reach, pending = _free_until(params, contact, motion, h)
        if not coasts:
            return False, state
    load = 0.5 * (contact.left_n + contact.right_n)
    coasts, motion1 = _coasted(params, motion, load, effort_n, h)
    if not coasts or motion1.gap_m <= reach:
        return False, state
    if contact.touched == 1:
        left_n, right_n, offset, touched, left, right, _, unbalanced = contact
        if load > 0.0:
            # The finger pushes the object towards the middle.
            pushed = 0.5 * (motion1.gap_m - reach)
            offset = pushed if offset >= 0.0 else -pushed
        contact = Contact(left_n, right_n, offset, touched, left, right, pending, unbalanced)
    next_s, n, unresolved = step
    return True, PlantState(motion1, contact, StepState(next_s, n + 1, unresolved), given, peak)


def _free_until(params: PlantParams, contact: Contact, motion: Motion, h: float) -> tuple[bool, float, float]:
    """Return whether an object that was touched is not pressed, the gap down to which, and the time it is behind."""
    model: ObjectModel = params.object
    left, right, pending = contact.left, contact.right, contact.pending_s
    if contact.left_n + contact.right_n > 0.0:
        pushed = not (
            left.force_n > 0.0 or left.compression_m != 0.0 or model.held == 1 or motion.speed_rev_s > 0.0
        )
        return pushed, model.width_m, pending
    reach = model.width_m + 2.0 * abs(contact.offset_m)
    pending += h
    change = pending * max(abs(left.rate_m_s), abs(right.rate_m_s))
    shape = max(abs(left.compression_m), abs(right.compression_m), SHAPE_SCALE_M)
    recovers = not (
        motion.gap_m <= reach
        or model.overshoots == 1
        or model.pads.damping_n_s_m > 0.0
        or model.pads.branch_n_m > 0.0
        or change * change > 2.0 * params.steps.tolerance * shape * shape
    )
    return recovers, reach, pending


def _coasted(
    params: PlantParams, motion: Motion, load_n: float, effort_n: float, h: float
) -> tuple[bool, Motion]:
    """Return whether the motion over `h` has no event of the drive and little error, and the motion after it."""
    drive, friction = params.drive, params.drive.friction
    revolutions, speed, _, jacobian = motion
    direction = 1.0 if speed > 0.0 else -1.0
    velocity = speed * jacobian
    excess, slope, curvature = stribeck_excess(friction, velocity)
    friction_n = friction.coulomb_n + friction.load_friction_coefficient * load_n + excess
    net = load_n - effort_n - direction * friction_n
    net -= friction.damping_n_s_m * velocity
    per_inertia = 1.0 / drive.inertia
    rate = jacobian * per_inertia * net
    # The linkage where the motion would end at constant speed; the rest of the path is linear.
    gap1, jacobian1 = gap_and_rate(drive.link, revolutions + h * speed)
    bend = jacobian1 - jacobian
    resistance = direction * slope + friction.damping_n_s_m
    change = per_inertia * (
        bend * (net - resistance * velocity) - jacobian * jacobian * resistance * (h * rate)
    )
    # Where friction has its maximum its slope is zero, and yet it changes.
    gained = h * rate * jacobian
    second_order = abs(jacobian) * per_inertia * 0.5 * abs(curvature) * gained * gained
    gain = 0.5 * h * rate
    speed1 = speed + h * (rate + 0.5 * change)
    if (speed + h * rate) * direction <= 0.0 or abs(velocity) < ARREST_M_S:
        return False, motion
    revolutions1 = revolutions + h * (speed + gain)
    gap1 += h * gain * jacobian1
    jacobian1 += bend / speed * gain
    coasts = (
        speed1 * direction > 0.0
        and drive.closed_rev < revolutions1 < drive.open_rev
        and h * abs(jacobian) * (abs(change) + second_order) <= params.steps.tolerance * SPEED_SCALE_M_S
    )
    return coasts, Motion(revolutions1, speed1, gap1, jacobian1)
