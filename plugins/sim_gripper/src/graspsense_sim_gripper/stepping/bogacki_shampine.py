"""The explicit Runge-Kutta pair of Bogacki and Shampine: of third order, with three evaluations of the object's force.

Bogacki and Shampine, Appl. Math. Lett. 2, 1989. The error is the difference to the embedded formula of second order;
the fourth stage is the first one of the next step. A term integrates its own state from the beginning of the step to
each stage, along the path to the stage's position. The errors of the positions cancel in the sum of the stages as
those of a spring's force do, so that the order holds for terms with a memory too, and for dampers behind pads, whose
rate is a backward difference of third order.
"""

from __future__ import annotations

from typing import Final

from graspsense.plugin_api import gap_and_rate
from graspsense_sim_gripper.dynamics.state import Motion
from graspsense_sim_gripper.stepping.implicit import acceleration_of, force_error, pressed
from graspsense_sim_gripper.stepping.scheme import Attempt, PlantParams, Start

SECOND: Final = 0.5
THIRD: Final = 0.75
"""Fractions of the step at the second and third stage."""
B1: Final = 2.0 / 9.0
B2: Final = 1.0 / 3.0
B3: Final = 4.0 / 9.0
"""Weights of the third-order formula."""
E1: Final = -5.0 / 72.0
E2: Final = 1.0 / 12.0
E3: Final = 1.0 / 9.0
E4: Final = -1.0 / 8.0
"""Weights of the difference to the second-order formula."""


def bogacki_shampine(params: PlantParams, start: Start, effort_n: float, h: float) -> Attempt:
    """Return the state after a step of `h`."""
    drive, direction = params.drive, start.direction
    revolutions, speed, _, jacobian = start.motion
    rate1 = start.acceleration
    speed2, rate2, speed3, rate3 = speed, rate1, speed, rate1
    motion, contact, rate = start.motion, start.contact, rate1
    # One loop, so that compiled code contains the force once.
    for stage in range(2, 5):
        if stage == 2:
            fraction, v, slope = SECOND, rate1, speed
        elif stage == 3:
            fraction, v, slope = THIRD, rate2, speed2
        else:
            fraction = 1.0
            v = B1 * rate1 + B2 * rate2 + B3 * rate3
            slope = B1 * speed + B2 * speed2 + B3 * speed3
        t = fraction * h
        v = speed + t * v
        revolutions1 = revolutions + t * slope
        gap, jacobian1 = gap_and_rate(drive.link, revolutions1)
        motion = Motion(revolutions1, v, gap, jacobian1)
        contact = pressed(params.object, start.contact, gap, -v * jacobian1, t)
        rate = acceleration_of(drive, jacobian1, v, contact, effort_n, direction)
        if stage == 2:
            speed2, rate2 = v, rate
        elif stage == 3:
            speed3, rate3 = v, rate
    speed_error = h * (E1 * rate1 + E2 * rate2 + E3 * rate3 + E4 * rate)
    position_error = h * (E1 * speed + E2 * speed2 + E3 * speed3 + E4 * motion.speed_rev_s)
    error_n = force_error(start, motion, contact, position_error)
    return Attempt(motion, contact, h, abs(speed_error * jacobian), error_n)
