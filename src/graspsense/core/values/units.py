"""Values and units as people read them: lengths in millimetres, one unit for a quantity in a whole output."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Final

STANDARD_GRAVITY_M_S2: Final = 9.80665
"""The standard acceleration of free fall, by which a gram-force is defined (3rd CGPM, 1901)."""


def display_unit(unit: str) -> tuple[str, float]:
    """Return the unit in which a quantity is shown, and the factor to it: mm for m, mm/s for m/s, mm2, cm3.

    An acceleration stays in m/s2.
    """
    if unit in _AREAS_AND_VOLUMES:
        return _AREAS_AND_VOLUMES[unit]
    length = unit == "m" or (unit.startswith("m/") and not unit.startswith(("m/s2", "m/s^2")))
    return (f"m{unit}", 1e3) if length else (unit, 1.0)


_AREAS_AND_VOLUMES: Final = {
    **{unit: (f"m{unit}", 1e6) for unit in ("m2", "m^2", "m²")},
    **{unit: (f"c{unit}", 1e6) for unit in ("m3", "m^3", "m³")},
}


_SI: Final = frozenset((
    "1", "s", "m", "kg", "A", "K", "mol", "cd", "rad", "sr", "Hz", "N", "Pa", "J", "W", "C", "V", "F", "Ω", "ohm",
    "S", "Wb", "T", "H", "lm", "lx", "counts", "cells", "rows", "dB",
))  # fmt: skip
"""The factors of a unit: those of the SI without a prefix, and what sensors give that have no unit."""


def is_si(unit: str) -> bool:
    """Return whether a unit is a product or a quotient of those of the SI without a prefix, or counts.

    >>> is_si("N s/m"), is_si("kg m2"), is_si("1"), is_si("newton"), is_si("mm"), is_si("")
    (True, True, True, False, False, False)
    """
    factors = re.split(r"[ /*\u00b7]", unit)
    return all(re.sub(r"(?<=\D)\^?-?[\d\u00b2\u00b3]$", "", factor) in _SI for factor in factors)


def in_column(value: float) -> str:
    """Return a number for a column: with three decimals, or with three digits where these would hide it.

    >>> in_column(57.8), in_column(0.0), in_column(2.5e-5), in_column(101325e3)
    ('   57.800', '    0.000', ' 2.50e-05', ' 1.01e+08')
    """
    fits = not 0.0 < abs(value) < 1e-3 and not abs(value) >= 1e5
    return f"{value:9.3f}" if fits else f"{value:9.2e}"


def in_words(value: float, unit: str) -> str:
    """Return a value with its unit, lengths in mm.

    >>> in_words(0.0578, "m"), in_words(3.2, "N"), in_words(0.25, "1")
    ('57.8 mm', '3.2 N', '0.25')
    """
    shown, factor = display_unit(unit)
    return with_unit(f"{value * factor:.4g}", shown)


def quantity(value: float, unit: str) -> str:
    """Return a value in a person's unit, lengths in mm: `57.86 mm`."""
    return "missing" if math.isnan(value) else in_words(value, unit)


def in_words_apart(values: Sequence[float], unit: str) -> list[str]:
    """Return values with their unit, with three significant digits or as many as tell different values apart."""
    shown, factor = display_unit(unit)
    scaled = [value * factor for value in values]
    for digits in range(3, 18):
        texts = [f"{value:.{digits}g}" for value in scaled]
        if len(set(texts)) == len(set(scaled)):
            break
    return [with_unit(text, shown) for text in texts]


def with_unit(number: str, shown: str) -> str:
    """Return a number with the unit in which it is shown; the unit 1, that of a ratio, is left out."""
    return f"{number} {shown}" if shown not in ("", "1") else number


def without_underscores(text: str) -> str:
    """Return a name without the underscores of a key."""
    return text.replace("_", " ")
