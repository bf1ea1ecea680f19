"""TR-BDF2: a trapezoidal stage and a stage of the second backward difference formula.

Of second order and L-stable, for motion that dampers make stiff (Bank, Coughran, Fichtner, Grosse, Rose and Smith, IEEE
Trans. Electron Devices 32, 1985). The error is estimated by an embedded formula of third order (Hosea and Shampine,
Appl. Numer. Math. 20, 1996).
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

from graspsense.plugin_api import gap_and_rate
from graspsense_sim_gripper.dynamics.state import Contact, Motion
from graspsense_sim_gripper.stepping.implicit import (
    acceleration_of,
    force_error,
    pressed,
    refined,
    search_from,
    speed_scale,
)
from graspsense_sim_gripper.stepping.scheme import Attempt, PlantParams, Start

GAMMA: Final = 2.0 - math.sqrt(2.0)
"""Fraction of the step after which the trapezoidal stage ends. With it both stages have the same weight."""
WEIGHT: Final = 1.0 - math.sqrt(0.5)
"""Weight of the rate at the end of each stage, as a fraction of the step."""
AHEAD: Final = 1.0 / (GAMMA * (2.0 - GAMMA))
BEHIND: Final = (1.0 - GAMMA) * (1.0 - GAMMA) / (GAMMA * (2.0 - GAMMA))
"""Weights of the middle and of the beginning in the backward difference."""
ESTIMATE: Final = 2.0 * (-3.0 * GAMMA * GAMMA + 4.0 * GAMMA - 2.0) / (12.0 * (2.0 - GAMMA))
EARLY: Final = 1.0 / GAMMA
MIDDLE: Final = 1.0 / (GAMMA * (1.0 - GAMMA))
LATE: Final = 1.0 / (1.0 - GAMMA)
"""Weights of the rates in the divided difference that estimates the error."""


class Stage(NamedTuple):
    """A stage: x1 = `from_rev` + `weight_s` v1 and v1 = `from_rev_s` + `weight_s` a(x1, v1)."""

    from_rev: float
    from_rev_s: float
    weight_s: float
    duration_s: float
    guess_rev_s: float
    scale_rev_s: float


def tr_bdf2(params: PlantParams, start: Start, effort_n: float, h: float) -> Attempt:
    """Return the state after a step of `h`."""
    revolutions, speed, _, jacobian = start.motion
    rate0, scale, weight = start.acceleration, speed_scale(start), WEIGHT * h
    # One loop, so that compiled code contains the stage once.
    stage = Stage(
        revolutions + weight * speed,
        speed + weight * rate0,
        weight,
        GAMMA * h,
        speed + GAMMA * h * rate0,
        scale,
    )
    contact, middle_speed, middle_rate = start.contact, speed, rate0
    motion, rate, slope = start.motion, rate0, 1.0
    for number in range(2):
        motion, contact, rate, slope = _solved(params, contact, stage, effort_n, start.direction)
        if number == 0:
            middle_speed, middle_rate = motion.speed_rev_s, rate
            stage = Stage(
                AHEAD * motion.revolutions - BEHIND * revolutions,
                AHEAD * middle_speed - BEHIND * speed,
                weight,
                (1.0 - GAMMA) * h,
                middle_speed + (1.0 - GAMMA) * h * rate,
                scale,
            )
    # Damped as the operator of the stages damps it.
    speed_error = ESTIMATE * h * (EARLY * rate0 - MIDDLE * middle_rate + LATE * rate) / slope
    position_error = (
        ESTIMATE * h * (EARLY * speed - MIDDLE * middle_speed + LATE * motion.speed_rev_s) / slope
    )
    error_n = force_error(start, motion, contact, position_error)
    return Attempt(motion, contact, h, abs(speed_error * jacobian), error_n)


def _solved(
    params: PlantParams, contact: Contact, stage: Stage, effort_n: float, direction: float
) -> tuple[Motion, Contact, float, float]:
    """Return motion, contact and acceleration at the end of a stage, and the slope of its residual."""
    from_rev, from_speed, weight, duration, guess, scale = stage
    drive, contact1, rate1 = params.drive, contact, 0.0
    revolutions1 = gap1 = jacobian1 = 0.0
    search = search_from(guess)
    while not search.done:
        v = search.speed_rev_s
        revolutions1 = from_rev + weight * v
        gap1, jacobian1 = gap_and_rate(drive.link, revolutions1)
        contact1 = pressed(params.object, contact, gap1, -v * jacobian1, duration)
        rate1 = acceleration_of(drive, jacobian1, v, contact1, effort_n, direction)
        search = refined(search, v - from_speed - weight * rate1, scale)
    return Motion(revolutions1, search.speed_rev_s, gap1, jacobian1), contact1, rate1, search.slope
