"""Numbers for people, and numbers as Java prints them."""

from __future__ import annotations

import math


def short(value: float, other: float | None = None) -> str:
    """Three significant digits, or as many as it takes to tell the value from another one."""
    for digits in range(3, 17):
        text = f"{value:.{digits}g}"
        if other is None or value == other or text != f"{other:.{digits}g}":
            return text
    return repr(value)


def java_double(value: float) -> str:
    """As Double.toString: plain between 1e-3 and 1e7, else with an exponent."""
    if value == 0 or 1e-3 <= abs(value) < 1e7:
        text = f"{value:.17f}".rstrip("0") if repr(value).count("e") else repr(value)
        return text + "0" if text.endswith(".") else text
    digits, exponent = _scientific(value)
    return f"{digits}E{exponent}"


def java_rounded(value: float, decimals: int) -> str:
    """As weka.core.Utils.doubleToString: at most so many decimals, no trailing zeros."""
    scaled = abs(value) * 10.0**decimals
    if scaled >= 2.0**63:
        return java_double(value)
    units = math.floor(scaled + 0.5)
    text = f"{units // 10**decimals}.{units % 10**decimals:0{decimals}d}".rstrip("0").rstrip(".")
    return f"-{text}" if value < 0 and units else text


def java_weight(weight: float) -> str:
    """A weight with two decimals at most, as J48's dump prints it."""
    return java_double(round(weight * 100.0) / 100.0)


def _scientific(value: float) -> tuple[str, int]:
    mantissa, exponent = f"{value!r}e0".split("e")[:2] if "e" in repr(value) else (repr(value), "0")
    sign = "-" if mantissa.startswith("-") else ""
    whole, _, fraction = mantissa.lstrip("-").partition(".")
    digits = (whole + fraction).lstrip("0")
    leading = len(whole) - 1 if whole.strip("0") else -(len(fraction) - len(fraction.lstrip("0")) + 1)
    digits = digits.rstrip("0") or "0"
    return f"{sign}{digits[0]}.{digits[1:] or '0'}", int(exponent) + leading
