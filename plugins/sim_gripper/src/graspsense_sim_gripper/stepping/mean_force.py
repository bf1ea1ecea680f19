"""A discrete-gradient step with the mean of the force along its path: of second order, and energy-conserving.

It suits lightly damped oscillations: the change of the kinetic energy equals the work on the path, so that the energy
of an oscillation does not drift (McLachlan, Quispel and Robidoux, Phil. Trans. R. Soc. A 357, 1999). The mean is
Simpson's rule, exact for a force that is a polynomial of third degree in the position.
"""

from __future__ import annotations

from typing import Final

from graspsense.plugin_api import gap_and_rate
from graspsense_sim_gripper.dynamics.state import Motion
from graspsense_sim_gripper.stepping.implicit import (
    acceleration_of,
    force_error,
    pressed,
    refined,
    search_from,
    speed_scale,
)
from graspsense_sim_gripper.stepping.scheme import Attempt, PlantParams, Start

MIN_ACCELERATION: Final = 1e-300
"""Added to a divisor, so that it is never 0."""


def mean_force(params: PlantParams, start: Start, effort_n: float, h: float) -> Attempt:
    """Return the state after a step of `h`."""
    drive, direction = params.drive, start.direction
    revolutions, speed, gap1, jacobian1 = start.motion
    rate0, scale, weight = start.acceleration, speed_scale(start), h / 6.0
    revolutions1, contact1, rate1 = revolutions, start.contact, rate0
    search = search_from(speed + h * rate0)
    while not search.done:
        v1 = search.speed_rev_s
        contact1, middle_rate, rate1 = start.contact, rate0, rate0
        for half in range(2):
            # To the middle of the path, then to its end, at the mean speed.
            middle_rate, part = rate1, 0.5 * (half + 1)
            v = speed + part * (v1 - speed)
            revolutions1 = revolutions + part * h * 0.5 * (speed + v1)
            gap1, jacobian1 = gap_and_rate(drive.link, revolutions1)
            contact1 = pressed(params.object, contact1, gap1, -v * jacobian1, 0.5 * h)
            rate1 = acceleration_of(drive, jacobian1, v, contact1, effort_n, direction)
        from_speed = speed + weight * (rate0 + 4.0 * middle_rate)
        search = refined(search, v1 - from_speed - weight * rate1, scale)
    motion1 = Motion(revolutions1, search.speed_rev_s, gap1, jacobian1)
    # As for the trapezoidal rule: the rate is taken at half the path instead of half the time.
    change, largest = rate1 - rate0, max(abs(rate0), abs(rate1), MIN_ACCELERATION)
    speed_error = h * change * change / (12.0 * largest)
    error_n = force_error(start, motion1, contact1, h * h * change / 12.0)
    return Attempt(motion1, contact1, h, abs(speed_error * start.motion.jacobian_m_rev), error_n)
