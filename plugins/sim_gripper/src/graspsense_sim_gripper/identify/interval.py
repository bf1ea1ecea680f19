"""The level of the intervals of an identification, and half their widths."""

from __future__ import annotations

from typing import Final

from graspsense.plugin_api import half_width

LEVEL: Final = 0.90


def student(degrees: int) -> float:
    """Return half the width of the interval of Student's t with so many degrees of freedom, in standard deviations."""
    return half_width(LEVEL, degrees)


def normal() -> float:
    """Return half the width of the interval of a normal distribution, in standard deviations."""
    return half_width(LEVEL)
