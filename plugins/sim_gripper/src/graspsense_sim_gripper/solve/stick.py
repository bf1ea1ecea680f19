"""Sticking: friction holds the drive while the object relaxes between the fingers, until they slip."""

from __future__ import annotations

from typing import Final

from graspsense_sim_gripper.plant.contact import has_event, pad_forces
from graspsense_sim_gripper.plant.drive import breakaway_friction, load_at_rest
from graspsense_sim_gripper.plant.state import Contact, Motion, right_of
from graspsense_sim_gripper.solve.control import MIN_STEP_S
from graspsense_sim_gripper.solve.events import until_event
from graspsense_sim_gripper.solve.scheme import PlantParams, PlantState

SLIP_ITERATIONS: Final = 6
SLIP_TOL_N: Final = 1e-6
"""Largest excess over the breakaway force when the fingers begin to slip."""
SLIP_AIM_N: Final = 5e-7
"""The search for that time aims at half of the excess, so that the fingers do slip."""
MIN_MARGIN_N: Final = 1e-9
"""Distance to slipping below which the time is not searched."""
MIN_SHARE: Final = 1e-6
"""Smallest fraction to which the search shortens the step."""


def stick(params: PlantParams, state: PlantState, effort_n: float, h: float) -> tuple[PlantState, float]:
    """Return the plant after the fingers have stood still for `h`, or until they begin to slip, and that time."""
    friction = params.drive.friction
    (revolutions, _, gap, jacobian), contact, step, given, peak = state
    load = load_at_rest(contact, effort_n)
    margin = breakaway_friction(friction, load) - abs(load - effort_n)
    t, after = h, contact
    for _ in range(SLIP_ITERATIONS):
        after = pad_forces(params.object, contact, gap, 0.0, t, True)
        load1 = load_at_rest(after, effort_n)
        margin1 = breakaway_friction(friction, load1) - abs(load1 - effort_n)
        if margin1 >= -SLIP_TOL_N or margin < MIN_MARGIN_N or t < MIN_SHARE * h:
            break
        t = max(t * (margin + SLIP_AIM_N) / (margin - margin1), min(t, MIN_STEP_S))
    if has_event(contact, after):
        t, after = until_event(params.object, contact, gap, 0.0, t, True)
    if after.left.force_n == 0.0 and right_of(after.left, after.right).force_n == 0.0:
        after = _against_table(after, 2.0 * max(effort_n, 0.0))
    peak = max(peak, after.left_n, after.right_n)
    return PlantState(
        motion=Motion(revolutions, 0.0, gap, jacobian), contact=after, step=step, effort_n=given, peak_n=peak
    ), t


def _against_table(contact: Contact, most_n: float) -> Contact:
    """Return the contact of an object that a finger presses against the table with at most this force."""
    left_n, right_n, offset, touched, left, right, pending, unbalanced = contact
    return Contact(
        left_n=min(left_n, most_n),
        right_n=min(right_n, most_n),
        offset_m=offset,
        touched=touched,
        left=left,
        right=right,
        pending_s=pending,
        unbalanced=unbalanced,
    )
