"""Common parts of the implicit schemes: the search for the speed at the end of a step, and the error of the force."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense_sim_gripper.dynamics.contact import ObjectModel, pad_forces
from graspsense_sim_gripper.dynamics.drive import Drive, sliding_friction
from graspsense_sim_gripper.dynamics.roots import MAX_ITERATIONS, bracketed_secant
from graspsense_sim_gripper.dynamics.state import Contact, Motion
from graspsense_sim_gripper.stepping.scheme import SPEED_SCALE_M_S, Start

SPEED_RTOL: Final = 1e-11
"""Tolerance of the search, relative to the scale of the speed."""
ARGUMENT_RTOL: Final = 1e-14
"""Difference of two speeds below which their secant is rounding."""
FIRST_STEP: Final = 1e-5
"""Difference of the first two speeds that are tried, as a fraction of the scale."""
MIN_SLOPE: Final = 0.1
"""The slope is 1 plus what the forces add to it, which is positive but where friction falls with the speed."""
SLOWEST_SHARE: Final = 1e-3
"""The least scale of the speed, as a share of the speed that errors are relative to."""


class SpeedSearch(NamedTuple):
    """The state of a secant search for the speed."""

    speed_rev_s: float
    last_rev_s: float
    last_residual: float
    slope: float
    lower_rev_s: float
    upper_rev_s: float
    n: int
    done: bool


def search_from(guess_rev_s: float) -> SpeedSearch:
    """Return a search that begins at this speed."""
    return SpeedSearch(guess_rev_s, guess_rev_s, 0.0, 1.0, -math.inf, math.inf, 0, False)


def refined(search: SpeedSearch, residual: float, scale_rev_s: float) -> SpeedSearch:
    """Return the search after the residual of its speed is known."""
    x, last, last_residual, slope, lower, upper, n, _ = search
    if n > 0 and abs(x - last) > ARGUMENT_RTOL * scale_rev_s:
        slope = max((residual - last_residual) / (x - last), MIN_SLOPE)
    if abs(residual) <= SPEED_RTOL * scale_rev_s * slope:
        return SpeedSearch(x, last, last_residual, slope, lower, upper, n, True)
    if residual > 0.0:
        upper = x
    else:
        lower = x
    if n == 0:
        following = x - math.copysign(FIRST_STEP * scale_rev_s, residual)
    else:
        following = bracketed_secant(x, residual, last, slope, lower, upper)
    done = following == x or n + 1 == MAX_ITERATIONS
    return SpeedSearch(following, x, residual, slope, lower, upper, n + 1, done)


def speed_scale(start: Start) -> float:
    """Return the speed (rev/s) that the tolerance of the search is relative to."""
    return max(
        abs(start.motion.speed_rev_s), SLOWEST_SHARE * SPEED_SCALE_M_S / abs(start.motion.jacobian_m_rev)
    )


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
    load = 0.5 * (contact.left_n + contact.right_n)
    friction_n = sliding_friction(drive.friction, speed_rev_s * jacobian_m_rev, load)
    damping_n = drive.friction.damping_n_s_m * speed_rev_s * jacobian_m_rev
    return jacobian_m_rev / drive.inertia * (load - effort_n - direction * friction_n - damping_n)


def force_error(start: Start, motion1: Motion, contact1: Contact, position_error_rev: float) -> float:
    """Return the error of the force (N) that this error of the position causes, by the mean stiffness of the step."""
    way = abs(motion1.revolutions - start.motion.revolutions)
    load = 0.5 * (start.contact.left_n + start.contact.right_n)
    load1 = 0.5 * (contact1.left_n + contact1.right_n)
    return abs(load1 - load) * abs(position_error_rev) / way if way > 0.0 else 0.0
