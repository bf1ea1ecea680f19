"""Units as people read them: millimetres for metres."""

from __future__ import annotations


def for_people(unit: str) -> tuple[str, float]:
    """Return the unit that stands for this one on a page, and the factor to it."""
    return (f"m{unit}", 1e3) if unit == "m" or unit.startswith("m/") else (unit, 1.0)


def in_a_line(text: str) -> str:
    """Return a name without the underscores of a key."""
    return text.replace("_", " ")
