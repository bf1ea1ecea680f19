"""The units of times, gaps, forces, efforts and velocities in the files of others, and the words for them."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Final

from graspsense.core.learn.target_value import name_and_unit
from graspsense.core.values.units import STANDARD_GRAVITY_M_S2

TO_SI: Final[Mapping[str, Mapping[str, float]]] = {
    "time": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9, "min": 60.0},
    "gap": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254},
    "force": {
        "N": 1.0,
        "mN": 1e-3,
        "kN": 1e3,
        "uN": 1e-6,
        "cN": 1e-2,
        "daN": 10.0,
        "gf": 1e-3 * STANDARD_GRAVITY_M_S2,
        "kgf": STANDARD_GRAVITY_M_S2,
        "lbf": 4.4482216152605,
    },
    "effort": {"N": 1.0, "mN": 1e-3, "kN": 1e3},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
}
"""The units of each quantity with their factor to the SI unit."""
_UNIT_WORDS: Final[Mapping[str, Mapping[str, str]]] = {
    "time": {
        **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
        **dict.fromkeys(("msec", "msecs", "millisecond", "milliseconds"), "ms"),
        **dict.fromkeys(("usec", "\u00b5s", "\u03bcs", "microsecond", "microseconds"), "us"),
        **dict.fromkeys(("mins", "minute", "minutes"), "min"),
    },
    "gap": {
        **dict.fromkeys(("inch", "inches"), "in"),
        **dict.fromkeys(("\u00b5m", "\u03bcm"), "um"),
        **dict.fromkeys(("millimeter", "millimeters", "millimetre", "millimetres"), "mm"),
        **dict.fromkeys(("meter", "meters", "metre", "metres"), "m"),
        "counts": "counts",
    },
    "force": {
        **dict.fromkeys(("newton", "newtons"), "N"),
        **dict.fromkeys(("\u00b5n", "\u03bcn"), "uN"),
        "kp": "kgf",
        **dict.fromkeys(("counts", "count", "raw", "adc"), "counts"),
    },
}
"""Other words for the units of a quantity, in small letters."""
GRAM_FORCE: Final = {
    **dict.fromkeys(("g", "gram", "grams", "gramm", "weight"), "gf"),
    **dict.fromkeys(("kg", "kilogram", "kilograms"), "kgf"),
    **dict.fromkeys(("lb", "lbs", "pounds"), "lbf"),
}
"""Units of mass, and names, with the force that a scale means by them."""
_MEGANEWTON: Final = "MN"
WITHOUT_UNIT: Final = ("", "-", "1")
"""What a line of units has for a column without one."""
UNITS: Final = frozenset((
    *(unit.lower() for units in TO_SI.values() for unit in units),
    *(word for words in _UNIT_WORDS.values() for word in words),
    *(word for word in GRAM_FORCE if word != "weight"),
    "-", "1", "%", "a.u.", "au", "step", "steps", "v", "mv", "a", "ma", "ohm", "hz", "khz", "rpm", "c", "\u00b0c",
    "degc", "k", "deg", "\u00b0", "rad", "rad/s", "deg/s", "pa", "kpa", "mpa", "bar", "psi", "nm", "n\u00b7m", "n*m",
    "n*mm", "nmm", "j", "mj", "w", "mw", "ozf", "n/m", "n/mm", "n/cm", "n/s", "mm/n", "m/s2", "m/s^2", "m/s\u00b2",
    "cm2", "mm2", "mm^2", "mm\u00b2", "ml", "cl", "dl", "ts", "rn",
))  # fmt: skip
"""What stands in a line of units, in small letters: units of the quantities above, and of others."""


_OF_TIME: Final = re.compile(r"\W*t\b|.*(time|elapsed|duration|clock|zeit|dauer)", re.IGNORECASE)
"""A heading behind which these are units, and not the least one, a height or a diameter."""

_APART: Final = re.compile(r"(.*\w)(?:, ?| / )(\w+)")
"""A name and perhaps a unit, without brackets."""


def unit_in(heading: str) -> str:
    """Return the unit behind a name: `Load [N]`, `Load (N)`, `Load / N` or `Load, N`.

    Only a time has minutes: `Load (min)` is the least.

    >>> unit_in("Load [kN]"), unit_in("time, ms"), unit_in("F / N"), unit_in("Load, min"), unit_in("force, left")
    ('kN', 'ms', 'N', '', '')
    """
    apart = _APART.fullmatch(heading)
    if apart and apart[2] not in ("min", "in") and any(apart[2] in units for units in TO_SI.values()):
        return apart[2]
    name, unit = name_and_unit(heading.translate(str.maketrans("()", "[]")))
    symbol = unit in ("min", "h", "d") and not _OF_TIME.match(name)
    return unit if unit.lower() in UNITS - {*WITHOUT_UNIT} and not symbol else ""


def names_and_units(headings: Sequence[str]) -> list[tuple[str, str]]:
    """Return the names and the units of the columns of a table.

    Brackets behind columns of one name are a part of their names, unless these are units.

    >>> names_and_units(["force [N]", "fill [score]", "cell [1]", "cell [2]"])
    [('force', 'N'), ('fill', 'score'), ('cell [1]', ''), ('cell [2]', '')]
    """
    pairs = [name_and_unit(heading) for heading in headings]
    times = Counter(name for name, _ in pairs)
    return [
        (heading, "") if times[pair[0]] > 1 and not unit_in(heading) else pair
        for heading, pair in zip(headings, pairs, strict=True)
    ]


DATES_S: Final = (946_684_800.0, 4_102_444_800.0)
"""The years 2000 and 2100, in seconds since 1970."""


def unit_since_1970(time: float) -> str:
    """Return the unit in which a number is a time of this century, empty if that is s, or if it is none."""
    low, high = DATES_S
    return next((unit for unit in ("ms", "us", "ns") if low <= time * TO_SI["time"][unit] < high), "")


def known_unit(text: str, quantity: str) -> str:
    """Return the unit of a quantity that a text means, empty if it means none.

    >>> known_unit("msec", "time"), known_unit("MM", "gap"), known_unit("mA", "force"), known_unit("MN", "force")
    ('ms', 'mm', '', '')
    """
    words = {unit.lower(): unit for unit in TO_SI[quantity]} | dict(_UNIT_WORDS.get(quantity, {}))
    return "" if text == _MEGANEWTON else words.get(text.lower(), "")
