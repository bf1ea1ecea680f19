"""Numbers that come out the same everywhere: comparisons, a logarithm, an exponential, fixed point.

J48 compares with a tolerance of 1e-6; that makes a decision depend on the last bits of a sum only in rare cases,
but an exact tree should not depend on them at all. So weights and ``x ln x`` terms are summed as integers (a sum of
integers has no order), and the two transcendental functions are written out in IEEE operations alone: numpy's and
a compiler's own differ in the last bit from machine to machine. Every function without an ``_array`` in its name
takes scalars as well as arrays, so that the compiled engine compiles these very lines.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-6
"""What J48 calls equal (weka.core.Utils.SMALL); also the argument below which x ln x counts as 0."""

LN2 = 0.6931471805599453
_LN2_HIGH = 0.693147180369123816490
_LN2_LOW = 1.90821492927058770002e-10
_SQRT_HALF = 0.7071067811865476

Array = NDArray[Any]


def select(condition: Any, where_true: Any, where_false: Any) -> Any:
    """One of two numbers, elementwise; the compiled engine has a branch of its own for this."""
    return np.where(condition, where_true, where_false)


def ln_of_parts(mantissa: Any, exponent: Any) -> Any:
    """Natural logarithm of ``mantissa * 2**exponent``, mantissa in [0.5, 1) as ``frexp`` gives it.

    The series of 2 artanh((m - 1) / (m + 1)) for m in [sqrt(1/2), sqrt(2)), to below one unit in the last place.
    """
    low = mantissa < _SQRT_HALF
    m = select(low, mantissa + mantissa, mantissa)
    e = exponent - low
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


def one_minus_exp(y: Any) -> Any:
    """``1 - exp(y)`` for ``y <= 0``, exact for small y too; below -700 it is that of -700.

    The series of exp(r) - 1 for r = y / 1024, then ten times (1 + q)**2 - 1.
    """
    r = np.maximum(y, -700.0) / 1024.0
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


def ln(x: float) -> float:
    """Natural logarithm of one positive number."""
    mantissa, exponent = math.frexp(x)
    return float(ln_of_parts(mantissa, exponent))


def x_ln_x_array(x: Array) -> Array:
    """``x ln x``, and 0 where x is below 1e-6 (J48's rule)."""
    mantissa, exponent = np.frexp(x)
    return np.where(x < TOLERANCE, 0.0, x * ln_of_parts(mantissa, exponent))


def bits_below(total: float, bits: int) -> int:
    """The number b of fractional bits for which ``total * 2**b`` stays below ``2**bits``."""
    return bits - math.frexp(total)[1]
