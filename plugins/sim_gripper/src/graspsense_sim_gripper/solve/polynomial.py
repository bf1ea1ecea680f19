"""Polynomials of the fraction s of a step, from values at its ends."""

from __future__ import annotations

from typing import NamedTuple


class Cubic(NamedTuple):
    """A cubic polynomial: c0 + s (c1 + s (c2 + s c3))."""

    c0: float
    c1: float
    c2: float
    c3: float


def hermite(x0: float, x1: float, slope0: float, slope1: float) -> Cubic:
    """Return the cubic polynomial with these values and derivatives with respect to s at s = 0 and s = 1."""
    change = x1 - x0
    return Cubic(x0, slope0, 3.0 * change - 2.0 * slope0 - slope1, slope0 + slope1 - 2.0 * change)


def parabola(x0: float, middle: float, x1: float) -> Cubic:
    """Return the parabola with these values at s = 0, 1/2 and 1."""
    bend = 2.0 * (x0 + x1 - 2.0 * middle)
    return Cubic(x0, x1 - x0 - bend, bend, 0.0)


def value(cubic: Cubic, s: float) -> float:
    """Return the value at s."""
    c0, c1, c2, c3 = cubic
    return c0 + s * (c1 + s * (c2 + s * c3))


def derivative(cubic: Cubic, s: float) -> float:
    """Return the derivative with respect to s at s."""
    _, c1, c2, c3 = cubic
    return c1 + s * (2.0 * c2 + 3.0 * s * c3)
