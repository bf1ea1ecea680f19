"""Quantiles of gap and forces, and of their rates, over the whole contact and over its halves.

An interval method for time series: what a quantile says does not depend on when exactly something happens. The
intervals and quantiles are fewer than in the source, so that each has a plain meaning. Source: A. Dempster, D. F.
Schmidt and G. I. Webb, "QUANT: a minimalist interval method for time series classification", arXiv:2308.00928.

The contact lasts from the first to the last time at which all pads feel the contact force. Gap and forces count as
functions of time that are linear between samples, at 128 evenly spaced times.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import Channel, Feature, Features, FeatureSet, Trace
from graspsense.plugins.features.contact_curve import (
    LEAST_SAMPLES,
    UNRESOLVED,
    CurveSamples,
    contact_curve,
    features_of,
    first_crossing,
)
from graspsense.plugins.features.contact_threshold import ContactThreshold

Floats = NDArray[np.float64]

POINTS: Final = 128
"""Number of times at which gap and forces are evaluated."""
CHANNELS: Final = (
    ("gap", "m", "gap"),
    ("high_force", "N", "force of the pad with the larger force"),
    ("low_force", "N", "force of the pad with the smaller force"),
)
STRETCHES: Final = (
    ("whole", slice(None), "the contact"),
    ("first", slice(None, POINTS // 2), "the first half of the contact"),
    ("second", slice(POINTS // 2, None), "the second half of the contact"),
)
QUANTILES: Final = (
    ("min", "smallest"),
    ("q25", "lower quartile of the"),
    ("median", "median"),
    ("q75", "upper quartile of the"),
    ("max", "largest"),
)
_NEEDS: Final = "needs three samples in the contact"
_CONTACT: Final = (
    Feature("contact_gap", "m", "gap at the contact; needs a contact", width=True),
    Feature("contact_time", "s", "time from the first to the last contact; needs a contact"),
)
_QUANTILES: Final = tuple(
    Feature(
        f"{channel}{suffix}_{stretch}_{quantile}",
        f"{unit}{per}",
        f"{words} {rate}{what} in {when}; {_NEEDS}",
    )
    for suffix, per, rate in (("", "", ""), ("_rate", "/s", "rate of the "))
    for stretch, _, when in STRETCHES
    for channel, unit, what in CHANNELS
    for quantile, words in QUANTILES
)
_OF_GAP: Final = frozenset(
    feature.name for feature in (*_CONTACT, *_QUANTILES) if feature.unit in ("m", "m/s")
)


class QuantileFeatures(FeatureSet[ContactThreshold]):
    """Extracts the quantiles; needs three samples in the contact."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = (*_CONTACT, *_QUANTILES)

    def extract(self, trace: Trace) -> Features:
        """Return the quantiles over the contact; all are missing without one."""
        names = [feature.name for feature in self.features]
        contact_force_n = self.config.contact_force_n
        curve = contact_curve(trace, contact_force_n)
        if isinstance(curve, str):
            return features_of(self, dict.fromkeys(names, curve), trace)
        samples, start_s = curve.samples, float(curve.t_s[0])
        last = int(np.flatnonzero(curve.lowest_n >= contact_force_n)[-1])
        lost_s = first_crossing(curve.t_s[last:], -curve.lowest_n[last:], -contact_force_n)
        end_s = float(curve.t_s[last]) if lost_s is None else lost_s
        values: list[float | str] = [
            curve.contact_gap_m if curve.resolved else UNRESOLVED,
            end_s - start_s,
        ]
        inside = (samples.t_s >= start_s) & (samples.t_s <= end_s)
        if np.count_nonzero(inside) < LEAST_SAMPLES:
            values += ["fewer than three samples in the contact"] * len(_QUANTILES)
        else:
            values += _quantiles(samples, start_s, end_s).tolist()
        return features_of(self, dict(zip(names, values, strict=True)), trace, _OF_GAP)


def _quantiles(samples: CurveSamples, start_s: float, end_s: float) -> Floats:
    """Return the quantiles in the order of their features."""
    grid_s = np.linspace(start_s, end_s, POINTS)
    pads = samples.pads
    columns = (samples.gap_m, pads.max(axis=0), pads.min(axis=0))
    values = np.array([np.interp(grid_s, samples.t_s, column) for column in columns])
    rates = np.diff(values, axis=1) / (grid_s[1] - grid_s[0])
    shares = np.linspace(0.0, 1.0, len(QUANTILES))
    parts = [
        np.quantile(series[:, part], shares, axis=1).T.ravel()
        for series in (values, rates)
        for _, part, _ in STRETCHES
    ]
    result: Floats = np.concatenate(parts)
    return result
