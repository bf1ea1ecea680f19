"""Filters of first order, by their bands: pure steps over named tuples of numbers.

The bands are those of Romano et al. (IEEE T-RO 27(6), 2011) as their controller pr2_gripper_sensor (2010) prints them.
Every filter begins as if its first sample had been there for ever, so that what is constant gives no transient.
"""

from __future__ import annotations

from math import pi, sqrt, tan
from typing import NamedTuple

RIPPLE_DB = 0.5
"""Ripple of the Chebyshev filters."""


class BandPass(NamedTuple):
    """The coefficients of y = b (x - x'') - a1 y' - a2 y''."""

    b: float
    a1: float
    a2: float


class BandPassState(NamedTuple):
    """The last two samples and the last two results; `begun` is 0 before the first sample."""

    begun: int
    x1: float
    x2: float
    y1: float
    y2: float


NOT_BEGUN = BandPassState(begun=0, x1=0.0, x2=0.0, y1=0.0, y2=0.0)


def high_pass(cutoff_hz: float, sample_s: float) -> float:
    """Return k of y = k (y' + x - x'): a high pass of first order, by backward differences.

    >>> round(high_pass(5.0, 0.041), 3)
    0.437
    """
    return 1.0 / (1.0 + 2.0 * pi * cutoff_hz * sample_s)


def band_pass(low_hz: float, high_hz: float, sample_s: float) -> BandPass:
    """Return the band pass of Chebyshev's first kind and first order, by the bilinear transform.

    Raises ValueError if the band is not below half the sampling rate.

    >>> [round(number, 4) for number in band_pass(0.8, 5.0, 0.041)]
    [0.6323, -0.6294, -0.2647]
    """
    if not 0.0 < low_hz < high_hz < 0.5 / sample_s:
        raise ValueError(
            f"a band of {low_hz:g} to {high_hz:g} Hz needs more than {2.0 * high_hz:g} samples a second"
        )
    low, high = tan(pi * low_hz * sample_s), tan(pi * high_hz * sample_s)
    width = (high - low) / sqrt(10.0 ** (RIPPLE_DB / 10.0) - 1.0)
    centre = low * high
    whole = 1.0 + width + centre
    return BandPass(width / whole, 2.0 * (centre - 1.0) / whole, (1.0 - width + centre) / whole)


def low_pass(cutoff_hz: float, sample_s: float) -> tuple[float, float]:
    """Return b and a of y = b (x + x') - a y': Butterworth's low pass of first order, by the bilinear transform.

    >>> [round(number, 4) for number in low_pass(1000.0, 1.0 / 3000.0)]
    [0.634, 0.2679]
    """
    warped = tan(pi * cutoff_hz * sample_s)
    return warped / (1.0 + warped), (warped - 1.0) / (warped + 1.0)


def band_passed(band: BandPass, state: BandPassState, x: float) -> BandPassState:
    """Return the state after a sample; `y1` is the result."""
    if state.begun == 0:
        return BandPassState(begun=1, x1=x, x2=x, y1=0.0, y2=0.0)
    y = band.b * (x - state.x2) - band.a1 * state.y1 - band.a2 * state.y2
    return BandPassState(begun=1, x1=x, x2=state.x1, y1=y, y2=state.y1)
