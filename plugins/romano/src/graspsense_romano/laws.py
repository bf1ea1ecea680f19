"""Find contact, force servo, slip servo, grab, release: the laws of Romano et al. as pure functions.

Each returns a rate of the gap (m/s, negative closes) or a force (N). `controllers.py` puts them together.
"""

from __future__ import annotations

from typing import NamedTuple


class Servo(NamedTuple):
    """The force servo: gains (m/s per N) for opening and closing, and the largest rate of the gap (m/s)."""

    opening_gain: float
    closing_gain: float
    limit_m_s: float


class PositionServo(NamedTuple):
    """The position servo that the rate is given to: gains, friction, bound of the position error, largest effort."""

    stiffness_n_m: float
    damping_n_s_m: float
    friction_n: float
    bound_m: float
    effort_limit_n: float


SLIP_GROWTH_1_S = 2.0
"""Rate at which the force grows while a thing slips: a factor of 1.002 for each millisecond, as published."""


def force_rate(servo: Servo, target_n: float, left_n: float, right_n: float) -> float:
    """Return the rate of the gap that brings the weaker finger to its target (force servo)."""
    error_n = target_n - min(left_n, right_n)
    gain = servo.closing_gain if error_n > 0.0 else servo.opening_gain
    return -min(max(gain * error_n, -servo.limit_m_s), servo.limit_m_s)


def raised_force(target_n: float, slips: int, dt_s: float, limit_n: float) -> float:
    """Return the force target after a tick, larger if the thing slips (slip servo)."""
    return min(target_n * (1.0 + SLIP_GROWTH_1_S * dt_s), limit_n) if slips == 1 else target_n


def grab_force(
    contact_n: float, speed_m_s: float, hardness: float, lightest_n: float, limit_n: float
) -> float:
    """Return the force (N) that fits a thing which gave this force at contact, closed upon at this speed (grab).

    A hard thing gives more force at contact than a soft one of the same place and is gripped harder.
    """
    return min(max(hardness * contact_n / speed_m_s, lightest_n), limit_n)


def servo_effort(
    servo: PositionServo, gap_m: float, velocity_m_s: float, wanted_m: float, rate_m_s: float
) -> float:
    """Return the effort (N) that brings the gap to a position that moves at a rate."""
    friction = 0.0
    if rate_m_s < 0.0:
        friction = servo.friction_n
    elif rate_m_s > 0.0:
        friction = -servo.friction_n
    effort_n = (
        servo.stiffness_n_m * (gap_m - wanted_m) + servo.damping_n_s_m * (velocity_m_s - rate_m_s) + friction
    )
    return min(max(effort_n, -servo.effort_limit_n), servo.effort_limit_n)
