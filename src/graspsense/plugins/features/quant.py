"""Quantiles of gap and forces on many intervals of the whole recording, with their rates and their spectrum.

No contact is needed: approach, contact and what follows count alike. Source: A. Dempster, D. F. Schmidt and G. I. Webb,
"QUANT: a minimalist interval method for time series classification", Data Mining and Knowledge Discovery 38 (2024)
2377, section 3 (arXiv:2308.00928); the depth and the number of quantiles are those of the paper.

Each channel counts as a function of time that is linear between samples, at 128 evenly spaced times from the first
sample to the last. From it four series are made: the value, its rate as the mean over 5 steps, the rate of the rate,
and the magnitude of the discrete Fourier transform. Each series is cut into 1, 2, 4, 8, 16 and 32 equal parts, and
from 2 parts on also into those that are shifted by half of a part. A part of m points has 1 + (m - 1) // 4 quantiles,
evenly spaced from the smallest to the largest value. From every second of them the mean of the part is subtracted.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.gripper_api import NO_GAP
from graspsense.plugin_api import APPROACH, Channel, Feature, Features, FeatureSet, Trace
from graspsense.plugins.features.contact_curve import Known, features_of, increasing

Floats = NDArray[np.float64]

POINTS: Final = 128
"""Number of times at which a channel is evaluated."""
DEPTH: Final = 6
POINTS_A_QUANTILE: Final = 4
SMOOTHED: Final = 5
"""Number of steps over which a rate is the mean."""
LEAST_SAMPLES: Final = 3
CHANNELS: Final = (
    ("gap", "m", "gap"),
    ("high_force", "N", "larger force of the pads"),
    ("low_force", "N", "smaller force of the pads"),
)
SERIES: Final = (
    ("value", "", "", POINTS),
    ("rate", "/s", "rate of the ", POINTS - 1),
    ("rate2", "/s2", "rate of the rate of the ", POINTS - 2),
    ("fourier", "", "Fourier magnitude of the ", POINTS // 2 + 1),
)
"""Name, unit beside that of the channel, words, and number of points."""
_NEEDS: Final = "needs three samples"


@frozen
class Interval:
    """A part of a series, from point `start` to before `end`."""

    name: str
    words: str
    start: int
    end: int

    @property
    def quantiles(self) -> int:
        """The number of its quantiles."""
        return 1 + (self.end - self.start - 1) // POINTS_A_QUANTILE


def intervals_of(points: int) -> list[Interval]:
    """Return the intervals of a series of this many points."""
    intervals: list[Interval] = []
    for depth in range(DEPTH):
        parts = 2**depth
        ends = np.linspace(0, points, parts + 1).astype(int)
        shifted = ends[:-1] + np.diff(ends) // 2
        for suffix, words, bounds in (("", "", ends), ("shifted", ", shifted by half of a part", shifted)):
            intervals += [
                Interval(f"{k}of{parts}{suffix}", f"part {k} of {parts}{words}", start, end)
                for k, (start, end) in enumerate(pairwise(bounds.tolist()), 1)
            ]
    return intervals


_INTERVALS: Final = {points: intervals_of(points) for *_, points in SERIES}
_FEATURES: Final = (
    Feature("duration", "s", f"time from the first sample to the last; {_NEEDS}"),
    *(
        Feature(
            f"{channel}_{series}_{part.name}_q{k + 1}of{part.quantiles}",
            f"{unit}{per}",
            f"quantile {k + 1} of {part.quantiles} of the {words}{what} in {part.words}"
            f"{', less the mean there' if k % 2 else ''}; {_NEEDS}",
        )
        for channel, unit, what in CHANNELS
        for series, per, words, points in SERIES
        for part in _INTERVALS[points]
        for k in range(part.quantiles)
    ),
)
A_CHANNEL: Final = (len(_FEATURES) - 1) // len(CHANNELS)
"""Number of the features of a channel."""


@frozen(kw_only=True)
class QuantConfig:
    """There is nothing to set."""


class QuantFeatures(FeatureSet[QuantConfig]):
    """Extracts the quantiles; needs three samples at different times."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = _FEATURES

    def extract(self, trace: Trace) -> Features:
        """Return the quantiles from the beginning of the approach to the last sample; a contact is not needed."""
        names = tuple(feature.name for feature in _FEATURES)
        t_s, columns = _samples(trace)
        duration = float(t_s[-1] - t_s[0]) if len(t_s) >= LEAST_SAMPLES else math.nan
        known: Known = {"duration": duration if duration == duration else "fewer than three samples"}
        for k, column in enumerate(columns):
            measured = np.isfinite(column)
            own = names[1 + k * A_CHANNEL : 1 + (k + 1) * A_CHANNEL]
            if k == 0 and trace.units.get("gap") == NO_GAP:
                known |= dict.fromkeys(own, "no gap was recorded")
            elif np.count_nonzero(measured) < LEAST_SAMPLES:
                known |= dict.fromkeys(own, f"fewer than three samples of the {CHANNELS[k][2]}")
            else:
                grid_s = np.linspace(0.0, duration, POINTS)
                series = np.interp(grid_s, t_s[measured] - t_s[0], column[measured])
                quantiles = interval_quantiles(series[np.newaxis], grid_s[1])[0].tolist()
                for name, value in zip(own, quantiles, strict=True):
                    known[name] = value if math.isfinite(value) else "its numbers are too large"
        return features_of(self, known, trace)


def interval_quantiles(series: Floats, step_s: float = 1.0) -> Floats:
    """Return the features of one channel of several recordings, shape (recordings, features).

    `series` has shape (recordings, POINTS), with `step_s` seconds from a point to the next.
    """
    kernel = np.full(SMOOTHED, 1.0 / SMOOTHED)
    with np.errstate(all="ignore"):
        rates = np.diff(series) / step_s
        smooth = np.array([np.convolve(row, kernel, mode="same") for row in rates])
        spectrum = np.abs(np.fft.rfft(series))
        made = (series, smooth, np.diff(rates) / step_s, spectrum)
        return np.concatenate([_of_intervals(values) for values in made], axis=1)


def _of_intervals(values: Floats) -> Floats:
    """Return the quantiles of all intervals of a series; intervals of equal length are computed at once."""
    intervals = _INTERVALS[values.shape[1]]
    ends = np.cumsum([part.quantiles for part in intervals])
    result = np.empty((len(values), int(ends[-1])))
    for length in {part.end - part.start for part in intervals}:
        chosen = [k for k, part in enumerate(intervals) if part.end - part.start == length]
        count = intervals[chosen[0]].quantiles
        points = np.array([intervals[k].start for k in chosen])[:, np.newaxis] + np.arange(length)
        parts = values[:, points]
        place = (np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])) * (length - 1)
        below = place.astype(int)
        above = np.minimum(below + 1, length - 1)
        ranked = np.sort(parts, axis=2)
        quantiles = ranked[:, :, below] + (place - below) * (ranked[:, :, above] - ranked[:, :, below])
        quantiles[:, :, 1::2] -= parts.mean(axis=2, keepdims=True)
        columns = (ends[chosen] - count)[:, np.newaxis] + np.arange(count)
        result[:, columns] = quantiles
    return result


def _samples(trace: Trace) -> tuple[Floats, tuple[Floats, Floats, Floats]]:
    """Return the times from the approach on, increasing, and gap, larger and smaller force at them."""
    ticks = np.flatnonzero((trace.phase >= APPROACH) & np.isfinite(trace.t_s))
    ticks = ticks[increasing(trace.t_s[ticks])]
    left, right = trace.force_left_n[ticks], trace.force_right_n[ticks]
    return trace.t_s[ticks], (trace.gap_m[ticks], np.fmax(left, right), np.fmin(left, right))
