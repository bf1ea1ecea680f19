"""The three signals of Romano et al.: low band and high band of the pads, and the acceleration band of the palm.

They are the analogues of what slowly adapting, fast adapting, and Pacinian receptors in the skin of a hand tell. The
filters are linear, so the sum of the cells is filtered instead of each cell.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final, NamedTuple

from graspsense.plugin_api import Frame, Reading, Samples
from graspsense_romano.filters import (
    NOT_BEGUN,
    BandPass,
    BandPassState,
    band_pass,
    band_passed,
    high_pass,
    low_pass,
)

PAD_SAMPLE_S = 0.041
"""Time between two images of the PR2's fingertips, at which the pads are sampled."""
PAD_HIGH_HZ = 5.0
PAD_LOW_HZ = (0.8, 5.0)
ACCELERATION_HZ = (5.0, 1000.0)
ACCELERATION_SAMPLE_S = 1.0 / 3000.0
SPEED_HZ = 5.0
LONGEST_S = 0.05
"""Ticks that are longer count as this long for the low pass of the speed: it needs two for each period."""


class Filters(NamedTuple):
    """The coefficients of the filters, and the time between two samples of the pads (s)."""

    sample_s: float
    high: float
    low: BandPass
    acceleration: BandPass
    speed_hz: float


class PadSignal(NamedTuple):
    """A pad: its force (N), the high band of that (N), and the low band, whose result is `low.y1` (N)."""

    begun: int
    force_n: float
    high_n: float
    low: BandPassState


class Acceleration(NamedTuple):
    """The acceleration band on three axes, and its greatest norm in this tick (m/s2); `present` is 1 with samples."""

    present: int
    x: BandPassState
    y: BandPassState
    z: BandPassState
    norm_m_s2: float


class Signals(NamedTuple):
    """The signals after a tick. `fresh` is 1 in a tick in which the pads were sampled."""

    fresh: int
    sampled_s: float
    left: PadSignal
    right: PadSignal
    edge_left: PadSignal
    edge_right: PadSignal
    acceleration: Acceleration
    speed_m_s: float
    """The rate of the gap after its low pass."""
    rate_m_s: float
    """The rate of the gap as it was measured."""


FILTERS: Final = Filters(
    sample_s=PAD_SAMPLE_S,
    high=high_pass(PAD_HIGH_HZ, PAD_SAMPLE_S),
    low=band_pass(*PAD_LOW_HZ, PAD_SAMPLE_S),
    acceleration=band_pass(*ACCELERATION_HZ, ACCELERATION_SAMPLE_S),
    speed_hz=SPEED_HZ,
)
"""The published filters.

That of the acceleration is for the 3 kHz of the PR2's sensor. Other rates move its band in proportion."""
_NO_PAD: Final = PadSignal(0, 0.0, 0.0, NOT_BEGUN)
NO_SIGNALS: Final = Signals(
    fresh=0,
    sampled_s=0.0,
    left=_NO_PAD,
    right=_NO_PAD,
    edge_left=_NO_PAD,
    edge_right=_NO_PAD,
    acceleration=Acceleration(present=0, x=NOT_BEGUN, y=NOT_BEGUN, z=NOT_BEGUN, norm_m_s2=0.0),
    speed_m_s=0.0,
    rate_m_s=0.0,
)
"""The signals before the first tick."""


def sampled(coefficients: Filters, pad: PadSignal, force_n: float) -> PadSignal:
    """Return a pad after a sample of its force (N); a force that is not a number changes nothing."""
    if force_n != force_n:
        return pad
    high_n = coefficients.high * (pad.high_n + force_n - pad.force_n) if pad.begun == 1 else 0.0
    return PadSignal(1, force_n, high_n, band_passed(coefficients.low, pad.low, force_n))


def felt(coefficients: Filters, earlier: Acceleration, samples: Samples) -> Acceleration:
    """Return the acceleration after the samples of a tick."""
    present, x, y, z, norm = earlier.present, earlier.x, earlier.y, earlier.z, 0.0
    for k in range(samples.new):
        row = samples.values[k]
        row = row if len(row) == 3 else (row[0], 0.0, 0.0)  # a sensor of one axis
        if row[0] + row[1] + row[2] == row[0] + row[1] + row[2]:
            band = coefficients.acceleration
            x, y, z = band_passed(band, x, row[0]), band_passed(band, y, row[1]), band_passed(band, z, row[2])
            present, norm = 1, max(norm, sqrt(x.y1 * x.y1 + y.y1 * y.y1 + z.y1 * z.y1))
    return Acceleration(present=present, x=x, y=y, z=z, norm_m_s2=norm)


def felt_if_measured(coefficients: Filters, earlier: Acceleration, signals: Any) -> Acceleration:
    """Return the acceleration after a tick; of a gripper without an accelerometer, that of before: none."""
    if len(signals) == 0:  # a compiler leaves the rest out
        return earlier
    if hasattr(signals, "acceleration"):
        return felt(coefficients, earlier, signals.acceleration)
    return earlier


def updated(coefficients: Filters, earlier: Signals, reading: Reading) -> Signals:
    """Return the signals after this reading."""
    frame: Frame = reading.frame
    fresh = 0
    sampled_s, left, right = earlier.sampled_s, earlier.left, earlier.right
    edge_left, edge_right = earlier.edge_left, earlier.edge_right
    if left.begun == 0 or frame.t_s - sampled_s >= coefficients.sample_s - 0.5 * frame.dt_s:
        fresh, sampled_s = 1, frame.t_s
        left, right = (
            sampled(coefficients, left, frame.force_left_n),
            sampled(coefficients, right, frame.force_right_n),
        )
        edge_left, edge_right = (
            sampled(coefficients, edge_left, frame.edge_left_n),
            sampled(coefficients, edge_right, frame.edge_right_n),
        )
    speed, rate = earlier.speed_m_s, earlier.rate_m_s
    if frame.velocity_m_s == frame.velocity_m_s:
        b, a = low_pass(coefficients.speed_hz, min(frame.dt_s, LONGEST_S))
        speed = b * (frame.velocity_m_s + rate) - a * speed
        rate = frame.velocity_m_s
    acceleration = felt_if_measured(coefficients, earlier.acceleration, reading.signals)
    return Signals(
        fresh=fresh,
        sampled_s=sampled_s,
        left=left,
        right=right,
        edge_left=edge_left,
        edge_right=edge_right,
        acceleration=acceleration,
        speed_m_s=speed,
        rate_m_s=rate,
    )
