"""Arithmetic with the same result everywhere: comparisons, a logarithm, an exponential, fixed point.

J48 compares with a tolerance of 1e-6, so that the last bits of a sum decide only in rare cases. An exact tree should
not depend on them at all. Weights and ``x ln x`` terms are therefore summed as integers, whose sum does not depend on
the order, and the two transcendental functions are written in IEEE operations, since those of numpy and of compilers
differ in the last bit between machines.

The functions are elementwise: they accept numbers and arrays. The compiled engine compiles the same lines. It
replaces three of them (`select`, `mantissa_and_exponent`, `to_integer`) by versions for one number, since numba's own
versions return arrays; see `depthfirst.compiled`.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from graspsense_c45.arrays import AnyArray, Elementwise, Integer, Real, Truth, Whole

TOLERANCE = 1e-6
"""Numbers closer than this are equal for J48 (weka.core.Utils.SMALL). ``x ln x`` counts as 0 for x below it."""

WEIGHT_BITS = 52
"""All weights together stay below 2**52 units, so that a float64 holds every sum of them exactly."""
TERM_BITS = 58
"""All ``x ln x`` terms together stay below 2**58 units."""

LN2 = 0.6931471805599453
_LN2_HIGH = 0.693147180369123816490
_LN2_LOW = 1.90821492927058770002e-10
_SQRT_HALF = 0.7071067811865476


class Scale(NamedTuple):
    """The units of fixed point: weights are integers times ``2**-weight_bits``, terms times ``2**-term_bits``."""

    weight_bits: int
    term_bits: int


def select(condition: Truth, where_true: Real | Whole, where_false: Real | Whole) -> AnyArray:
    """Return one of two numbers, elementwise."""
    return np.where(condition, where_true, where_false)


def mantissa_and_exponent(x: Real) -> tuple[Real, Whole]:
    """Return m in [0.5, 1) and an integer e with ``x = m * 2**e``; both are 0 for 0."""
    return np.frexp(x)


def to_integer(x: Real) -> Elementwise:
    """Return an integral number as a 64-bit integer."""
    return np.asarray(x, dtype=np.int64)


def ln(x: Real) -> Elementwise:
    """Return the natural logarithm of positive numbers, to below one unit in the last place.

    With ``x = m * 2**e`` and m in [sqrt(1/2), sqrt(2)), the logarithm of m is the series of 2 artanh((m - 1) / (m +
    1)).
    """
    mantissa, exponent = mantissa_and_exponent(x)
    low = mantissa < _SQRT_HALF
    m = select(low, mantissa + mantissa, mantissa)
    e = exponent - low
    f = (m - 1.0) / (m + 1.0)
    z = f * f
    series: Real = 1.0 / 23.0
    series = series * z + 1.0 / 21.0
    series = series * z + 1.0 / 19.0
    series = series * z + 1.0 / 17.0
    series = series * z + 1.0 / 15.0
    series = series * z + 1.0 / 13.0
    series = series * z + 1.0 / 11.0
    series = series * z + 1.0 / 9.0
    series = series * z + 1.0 / 7.0
    series = series * z + 1.0 / 5.0
    series = series * z + 1.0 / 3.0
    tail = 2.0 * f * z * series + e * _LN2_LOW
    return e * _LN2_HIGH + (2.0 * f + tail)


def one_minus_exp(y: Real) -> Real:
    """Return ``1 - exp(y)`` for ``y <= 0``, without cancellation near 0; below -700 the value at -700.

    q is first the series of exp(r) - 1 at r = y / 1024, and is then replaced ten times by (1 + q)**2 - 1.
    """
    r = np.maximum(y, -700.0) / 1024.0
    q: Real = 1.0 / 14.0
    q = (q * r + 1.0) / 13.0
    q = (q * r + 1.0) / 12.0
    q = (q * r + 1.0) / 11.0
    q = (q * r + 1.0) / 10.0
    q = (q * r + 1.0) / 9.0
    q = (q * r + 1.0) / 8.0
    q = (q * r + 1.0) / 7.0
    q = (q * r + 1.0) / 6.0
    q = (q * r + 1.0) / 5.0
    q = (q * r + 1.0) / 4.0
    q = (q * r + 1.0) / 3.0
    q = (q * r + 1.0) / 2.0
    q = (q * r + 1.0) * r
    for _ in range(10):
        q = q * (2.0 + q)
    return -q


def x_ln_x(x: Real) -> Real:
    """Return ``x ln x``, and 0 for x below the tolerance (J48's rule)."""
    return select(x < TOLERANCE, 0.0, x * ln(x))


def real_weight(units: Whole, weight_bits: Integer) -> Elementwise:
    """Return a fixed-point weight as a number of rows (exact)."""
    return np.ldexp(units * 1.0, -weight_bits)


def real_term(units: Whole, term_bits: int) -> Real:
    """Return a fixed-point term as a number."""
    return np.ldexp(units * 1.0, -term_bits)


def term(units: Whole, scale: Scale) -> Elementwise:
    """Return ``x ln x`` of a fixed-point weight as a fixed-point term."""
    return to_integer(np.rint(np.ldexp(x_ln_x(real_weight(units, scale.weight_bits)), scale.term_bits)))


def bits_below(total: float, bits: int) -> int:
    """Return the largest number b of fractional bits for which ``total * 2**b`` is below ``2**bits``."""
    return bits - math.frexp(total)[1]


def first_maximum(columns: AnyArray, start: float | Integer, margin: float | Integer) -> Elementwise:
    """Return the index of the first entry that no later one exceeds by more than `margin`.

    The scan goes along the first axis of `columns`; the first entry is compared with `start`, and 0 is returned where
    no entry exceeds that.
    """
    best: Elementwise = start
    chosen: Whole = 0
    for k in range(len(columns)):
        better = columns[k] - best > margin
        best = select(better, columns[k], best)
        chosen = select(better, k, chosen)
    return chosen
