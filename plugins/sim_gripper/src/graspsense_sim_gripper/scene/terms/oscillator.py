"""The exact motion of a damped oscillator under a force that is quadratic in time, used by three terms."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

SERIES_BELOW: Final = 2.5e-3
"""Square of the step, in the time scales of oscillation and damping, below which the motion is a power series. The
closed form is a difference of large numbers there."""
SERIES_ORDER: Final = 9
"""The remainder is then below rounding."""


class OscillatorState(NamedTuple):
    """Position (m) and velocity (m/s) of the mass."""

    y_m: float
    v_m_s: float


class Forcing(NamedTuple):
    """The force on the oscillator per mass (m/s²), u0 + u1 t + u2 t²."""

    u0: float
    u1: float
    u2: float


def moved(now: OscillatorState, damping: float, square: float, forcing: Forcing, h: float) -> OscillatorState:
    """Return the motion after `h` seconds of y'' + 2 a y' + w2 y = u0 + u1 t + u2 t².

    `damping` is a (1/s, not negative) and `square` w2 (1/s2, positive). Exact for any `h`, underdamped or overdamped.
    """
    a, w2 = damping, square
    if (w2 + a * a) * h * h < SERIES_BELOW:
        return _by_series(now, a, w2, forcing, h)
    # The motion without its own oscillation: offset + slope t + bend t².
    bend = forcing.u2 / w2
    slope = (forcing.u1 - 4.0 * a * bend) / w2
    offset = (forcing.u0 - 2.0 * a * slope - 2.0 * bend) / w2
    y, v = now.y_m - offset, now.v_m_s - slope
    discriminant = w2 - a * a
    if discriminant > 1e-12 * w2:
        w = math.sqrt(discriminant)
        decay = math.exp(-a * h)
        even = decay * math.cos(w * h)
        odd = decay * math.sin(w * h) / w
    elif discriminant < -1e-12 * w2:
        w = math.sqrt(-discriminant)
        # The slow root as a quotient: a difference would lose it by cancellation.
        slow, fast = math.exp(-w2 / (a + w) * h), math.exp(-(a + w) * h)
        even = 0.5 * (slow + fast)
        odd = 0.5 * (slow - fast) / w
    else:
        even = math.exp(-a * h)
        odd = even * h
    return OscillatorState(
        offset + h * (slope + bend * h) + y * even + (v + a * y) * odd,
        slope + 2.0 * bend * h + v * even - (a * v + w2 * y) * odd,
    )


def _by_series(now: OscillatorState, a: float, w2: float, forcing: Forcing, h: float) -> OscillatorState:
    """Return what `moved` returns, by the power series of the motion in `h`."""
    u0, u1, u2 = forcing
    # The coefficients times h^(n - 1); their recurrence is the differential equation.
    previous, last = now.v_m_s, 0.5 * h * (u0 - 2.0 * a * now.v_m_s - w2 * now.y_m)
    moved_m_s, speed = previous + last, previous + 2.0 * last
    drives = (u1 * h * h, u2 * h * h * h)
    for n in range(3, SERIES_ORDER + 1):
        drive = drives[n - 3] if n < 5 else 0.0
        term = (drive - 2.0 * a * h * (n - 1) * last - w2 * h * h * previous) / (n * (n - 1))
        moved_m_s += term
        speed += n * term
        previous, last = last, term
    return OscillatorState(now.y_m + h * moved_m_s, speed)
