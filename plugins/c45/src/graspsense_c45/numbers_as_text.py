"""Numbers as short text, and as Weka prints them."""

from __future__ import annotations

import math
from decimal import ROUND_HALF_EVEN, Decimal


def short(value: float, other: float | None = None) -> str:
    """Return three significant digits, or as many as distinguish the value from another one."""
    for digits in range(3, 17):
        text = f"{value:.{digits}g}"
        if other is None or value == other or text != f"{other:.{digits}g}":
            return text
    return repr(value)


def weka_number(value: float) -> str:
    """Return a number as weka.core.Utils.doubleToString with 6 decimals: plain digits, no trailing zeros."""
    exact = Decimal(repr(value))
    if exact.as_tuple().exponent < -6:  # type: ignore[operator]
        exact = exact.quantize(Decimal("0.000001"), ROUND_HALF_EVEN)
    text = f"{exact:f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def weka_weight(weight: float) -> str:
    """Return a weight as weka.core.Utils.roundDouble with 2 decimals and Double.toString: one decimal at least."""
    rounded = math.floor(weight * 100.0 + 0.5) / 100.0
    if rounded < 1e7:
        return repr(rounded)
    mantissa, exponent = f"{Decimal(repr(rounded)).normalize():E}".split("E")
    return f"{mantissa if '.' in mantissa else mantissa + '.0'}E{int(exponent)}"
