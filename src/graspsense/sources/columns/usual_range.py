"""The range of a force or a gap without its glitches."""

from __future__ import annotations

from typing import Final

import numpy as np

from graspsense.sources.formats.table import Numbers

GLITCHES: Final = 0.01
"""Share of the samples that can be glitches, at each end of the range."""


def usual_range(values: Numbers) -> tuple[float, float]:
    """Return the least and the largest value, apart from one sample in a hundred at each end, which may be a glitch."""
    low = np.quantile(values, GLITCHES, method="higher")
    high = np.quantile(values, 1.0 - GLITCHES, method="lower")
    return float(low), float(high)
