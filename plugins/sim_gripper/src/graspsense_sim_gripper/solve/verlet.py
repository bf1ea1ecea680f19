"""Velocity Verlet (kick, drift, kick): explicit, of second order, with one evaluation of the force of the object.

Swope, Andersen, Berens and Wilson, J. Chem. Phys. 76, 1982. A step ends at the first event on its path. Its error is
estimated from the change of the acceleration.
"""

from __future__ import annotations

import math
from typing import Final

from graspsense_sim_gripper.plant.balance import balance_tolerance
from graspsense_sim_gripper.plant.contact import pad_forces
from graspsense_sim_gripper.plant.drive import acceleration, sliding_friction
from graspsense_sim_gripper.plant.state import Contact, Motion, right_of
from graspsense_sim_gripper.solve.events import drift
from graspsense_sim_gripper.solve.scheme import SPEED_SCALE_M_S, Attempt, PlantParams, Start

ROUNDING: Final = 4e-16
"""Relative rounding of a compression."""
SEARCH_ROUNDING: Final = 4.0
"""Multiple of the tolerance of the force balance by which two solutions can differ."""


def verlet(params: PlantParams, start: Start, effort_n: float, h: float) -> Attempt:
    """Return the state after a step of `h`, or at the first event within it; a motion that reverses ends at rest."""
    drive = params.drive
    _, speed, _, _ = start.motion
    drifted, t = drift(params, start, h)
    revolutions1, speed1, gap1, jacobian1 = drifted
    contact1, meets = start.contact, False
    if contact1.touched == 1 or gap1 <= start.reach_m:
        # A contact that begins now has lasted no time, but rigid pads transmit the force of a damper immediately.
        meets = contact1.touched == 0
        contact1 = pad_forces(params.object, contact1, gap1, -speed1 * jacobian1, 0.0 if meets else t, False)
    load1 = 0.5 * (contact1.left_n + contact1.right_n)
    friction_n = sliding_friction(drive.friction, speed1 * jacobian1, load1)
    rate1 = acceleration(drive, jacobian1, speed1, load1 - effort_n, friction_n, start.direction)
    if meets:
        # The force of the contact belongs to the next step.
        rate1 = start.acceleration
    speed1 = speed + 0.5 * t * (start.acceleration + rate1)
    speed_error = force_error = 0.0
    if params.steps.tolerance < math.inf:
        speed_error, force_error = _errors(params, start, contact1, rate1, speed1, t)
    if not speed1 * start.direction > 0.0:
        # The motion has reversed, and friction changes its sign there.
        speed1 = 0.0
    motion1 = Motion(revolutions1, speed1, gap1, jacobian1)
    return Attempt(
        motion=motion1, contact=contact1, duration_s=t, speed_error_m_s=speed_error, force_error_n=force_error
    )


def _errors(
    params: PlantParams, start: Start, contact1: Contact, rate1: float, speed1: float, t: float
) -> tuple[float, float]:
    """Return the errors of speed (m/s) and force (N)."""
    (_, speed, _, jacobian), contact, _, rate, _, _ = start
    left1, right1 = contact1.left, right_of(contact1.left, contact1.right)
    load = 0.5 * (contact.left_n + contact.right_n)
    load1 = 0.5 * (contact1.left_n + contact1.right_n)
    change = rate1 - rate
    # A difference of forces that is rounding says nothing about the step.
    noise_n = ROUNDING * max(
        left1.slope_n_m * abs(left1.compression_m), right1.slope_n_m * abs(right1.compression_m)
    )
    noise_n += SEARCH_ROUNDING * balance_tolerance(params.object, max(load, load1))
    if abs(change) * params.drive.inertia <= noise_n * abs(jacobian):
        change = 0.0
    speed_error = force_error = 0.0
    # In most ticks nothing is touched and so little changes that the errors are negligible.
    if contact.touched == 1 or abs(t * change * jacobian) > params.steps.tolerance * SPEED_SCALE_M_S:
        largest = max(abs(rate), abs(rate1))
        if largest > 0.0:
            speed_error = abs(t * change * change / (12.0 * largest) * jacobian)
        fastest = max(abs(speed), abs(speed1))
        if fastest > 0.0:
            force_error = abs((load1 - load) * t * change / (6.0 * fastest))
    return speed_error, force_error
