"""The 22 canonical time-series characteristics of the force over time, by pycatch22 (the extra `catch22`).

The series is the force from the contact to the release or the end of the trace, linear between samples and evaluated
at 128 evenly spaced times, so that the spacing of the samples has no weight. pycatch22 standardises it: force and
duration of the grasp have no influence, only the course. Source: C. H. Lubba and others, "catch22: CAnonical
Time-series CHaracteristics", Data Mining and Knowledge Discovery 33 (2019) 1821.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
import pycatch22

from graspsense.plugin_api import Channel, Feature, Features, FeatureSet, Trace, missing
from graspsense.plugins.features.contact_curve import contact_curve
from graspsense.plugins.features.contact_threshold import ContactThreshold

POINTS: Final = 128
"""Number of times at which the series is evaluated; a time scale below is a number of such points."""
LEAST_SAMPLES: Final = 8
"""Number of samples from which on the course of the force is more than the interpolation between them."""


class Catch22Features(FeatureSet[ContactThreshold]):
    """Extracts the 22 characteristics; needs a contact, and eight samples from there to the release."""

    requires = (Channel("gap", "m"), Channel("force_left", "N"), Channel("force_right", "N"))
    features = tuple(
        Feature(name, "1", f"{meaning}; needs eight samples from the contact to the release")
        for name, meaning in (
            ("mode_5", "most frequent force, of 5 bins"),
            ("mode_10", "most frequent force, of 10 bins"),
            ("outlier_timing_pos", "when forces far above the mean occur"),
            ("outlier_timing_neg", "when forces far below the mean occur"),
            ("acf_timescale", "points after which the autocorrelation is below 1/e"),
            ("acf_first_min", "points to the first minimum of the autocorrelation"),
            ("low_freq_power", "power in the lowest fifth of the frequencies"),
            ("median_freq", "frequency (rad per point) with half of the power below it"),
            ("forecast_error", "error of the forecast by the mean of the last three points"),
            ("whiten_timescale", "change of the time scale of the autocorrelation by differencing"),
            ("high_fluctuation", "share of the steps above 4 % of the standard deviation"),
            ("stretch_high", "most points in a row above the mean"),
            ("stretch_decreasing", "most steps in a row that decrease"),
            ("entropy_pairs", "entropy of pairs of successive points, of three levels"),
            ("ami2", "mutual information of points two apart, of 5 bins"),
            ("trev", "asymmetry of the steps: mean of their cubes"),
            ("ami_timescale", "points to the first minimum of the mutual information"),
            ("transition_variance", "spread of the transitions between three levels"),
            ("periodicity", "period in points; 0 without one"),
            ("embedding_dist", "how far distances in a delay embedding are from an exponential distribution"),
            ("rs_range", "share of the scales in the first regime of the rescaled range"),
            ("dfa", "share of the scales in the first regime of the detrended fluctuations"),
        )
    )

    def extract(self, trace: Trace) -> Features:
        """Return the characteristics; one that pycatch22 does not define for this series is NaN with the reason."""
        curve = contact_curve(trace, self.config.contact_force_n)
        if isinstance(curve, str):
            return self.undefined(curve)
        if np.count_nonzero(curve.t_s <= curve.end_s) < LEAST_SAMPLES:
            return self.undefined(f"fewer than {LEAST_SAMPLES} samples from the contact to the release")
        t_s = np.linspace(curve.t_s[0], curve.end_s, POINTS)
        force = np.interp(t_s, curve.t_s, curve.force_n)
        computed = pycatch22.catch22_all(force.tolist(), short_names=True, mask_nans=False)
        values = {
            name: value
            for name, value in zip(computed["short_names"], computed["values"], strict=True)
            if math.isfinite(value)
        }
        absent = [feature.name for feature in self.features if feature.name not in values]
        return self.result(values, missing(absent, "pycatch22 does not define it for this force"))
