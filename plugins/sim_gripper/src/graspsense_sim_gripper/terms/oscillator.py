"""A mass on a spring and a damper under a force that rises evenly: its exact motion, which three terms share."""

from __future__ import annotations

import math
from typing import NamedTuple


class OscillatorState(NamedTuple):
    """Where the mass stands (m) and how fast it moves (m/s)."""

    y_m: float
    v_m_s: float


def moved(
    now: OscillatorState, damping: float, square: float, u0: float, u1: float, h: float
) -> OscillatorState:
    """Return the motion after `h` seconds of y'' + 2 a y' + w2 y = u0 + u1 t.

    `damping` is a (1/s, not negative) and `square` w2 (1/s2, greater than 0). Exact at any `h`, whichever is
    larger.
    """
    a, w2 = damping, square
    slope = u1 / w2
    offset = (u0 - 2.0 * a * slope) / w2
    y, v = now.y_m - offset, now.v_m_s - slope
    rest = w2 - a * a
    if rest > 1e-12 * w2:
        w = math.sqrt(rest)
        decay = math.exp(-a * h)
        even = decay * math.cos(w * h)
        odd = decay * math.sin(w * h) / w
    elif rest < -1e-12 * w2:
        w = math.sqrt(-rest)
        # The slow root as a quotient: as a difference it is lost in rounding.
        slow, fast = math.exp(-w2 / (a + w) * h), math.exp(-(a + w) * h)
        even = 0.5 * (slow + fast)
        odd = 0.5 * (slow - fast) / w
    else:
        even = math.exp(-a * h)
        odd = even * h
    return OscillatorState(
        offset + slope * h + y * even + (v + a * y) * odd,
        slope + v * even - (a * v + w2 * y) * odd,
    )
