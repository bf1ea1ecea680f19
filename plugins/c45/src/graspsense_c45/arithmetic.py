"""Arithmetic with the same result everywhere: comparisons, a logarithm, an exponential, fixed point.

J48 compares with a tolerance of 1e-6, so that the last bits of a sum decide only in rare cases. An exact tree should
not depend on them at all. Weights and ``x ln x`` terms are therefore summed as integers, whose sum does not depend on
the order, and the two transcendental functions are written in IEEE operations, since those of numpy and of compilers
differ in the last bit between machines.

The functions are for single numbers. The compiler takes the same lines; `building.compiled` says what it replaces.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

from graspsense_c45.arrays import Integers, Numbers

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


def ln(x: float) -> float:
    """Return the natural logarithm of positive numbers, to below one unit in the last place.

    With ``x = m * 2**e`` and m in [sqrt(1/2), sqrt(2)), the logarithm of m is the series of 2 artanh((m - 1) / (m +
    1)).
    """
    m, e = math.frexp(x)
    if m < _SQRT_HALF:
        m += m
        e -= 1
    f = (m - 1.0) / (m + 1.0)
    z = f * f
    series = 1.0 / 23.0
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


def one_minus_exp(y: float) -> float:
    """Return ``1 - exp(y)`` for ``y <= 0``, without cancellation near 0; below -700 the value at -700.

    q is first the series of exp(r) - 1 at r = y / 1024, and is then replaced ten times by (1 + q)**2 - 1.
    """
    r = max(y, -700.0) / 1024.0
    q = 1.0 / 14.0
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


def x_ln_x(x: float) -> float:
    """Return ``x ln x``, and 0 for x below the tolerance (J48's rule)."""
    return 0.0 if x < TOLERANCE else x * ln(x)


def real_weight(units: int, weight_bits: int) -> float:
    """Return a fixed-point weight as a number of rows (exact)."""
    return math.ldexp(float(units), -weight_bits)


def real_term(units: int, term_bits: int) -> float:
    """Return a fixed-point term as a number."""
    return math.ldexp(float(units), -term_bits)


def term(units: int, scale: Scale) -> int:
    """Return ``x ln x`` of a fixed-point weight as a fixed-point term."""
    return _known_term(units, scale)


def new_term(units: int, scale: Scale) -> int:
    """Return what `term` does, computed again."""
    return round(math.ldexp(x_ln_x(real_weight(units, scale.weight_bits)), scale.term_bits))


_known_term = lru_cache(maxsize=1 << 16)(new_term)
"""In the interpreter a term takes longer than the rest of a step, and the same weights come again and again."""


def bits_below(total: float, bits: int) -> int:
    """Return the largest number b of fractional bits for which ``total * 2**b`` is below ``2**bits``."""
    return bits - math.frexp(total)[1]


def first_maximum(numbers: Numbers | Integers, start: float, margin: float) -> int:
    """Return the index of the first entry that no later one exceeds by more than `margin`.

    The first entry is compared with `start`, and 0 is returned where no entry exceeds that.
    """
    best, chosen = start, 0
    for k in range(len(numbers)):
        if numbers[k] - best > margin:
            best, chosen = numbers[k], k
    return chosen
