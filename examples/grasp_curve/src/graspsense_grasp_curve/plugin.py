"""The components of this distribution. numpy is imported when features are extracted."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import Channel, Feature, FeatureSetEntry, hookimpl

GRASPSENSE_API = (1, 0)

SIX = (
    Feature("p_first", "m", "gap at the first contact of both fingers", width=True),
    Feature("p_steady", "m", "gap when the fingers have come to rest"),
    Feature("f_steady", "N", "force on the pads when the fingers have come to rest"),
    Feature("delta_t", "s", "time from the first contact to rest"),
    Feature("dp_dt", "m/s", "mean rate of the gap from the first contact to rest"),
    Feature("df_dt", "N/s", "mean rate of the pad force from the first contact to rest"),
)
CURVE = (
    Feature("peak_force", "N", "largest mean force of the pads, from contact to the end of the hold"),
    Feature("gap_at_peak", "m", "gap at the largest force"),
    Feature(
        "stiffness_ratio",
        "1",
        "slope of force over gap in the second half of the squeeze, over that in the first",
    ),
    Feature("hysteresis", "1", "share of the work of the squeeze that the release does not give back"),
    Feature("relaxation_time", "s", "time from the peak until 63 % of the relaxation of the hold has passed"),
    Feature("contact_area", "cells", "cells of a pad above a tenth of the fullest cell, at the peak"),
    Feature("contact_row", "rows", "centre of the contact along the pad, at the peak"),
    Feature("contact_spread", "rows", "standard deviation of the contact along the pad, at the peak"),
)


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return two sets: the eight features, and these after the six of Table I."""
    channels = (
        Channel("gap", "m"),
        Channel("force_left", "N"),
        Channel("force_right", "N"),
        Channel("pads", "counts"),
    )
    yield FeatureSetEntry(
        name="grasp-curve",
        target="graspsense_grasp_curve.features:GraspCurveFeatures",
        config="graspsense_grasp_curve.features:GraspCurveConfig",
        summary="peak, stiffness ratio, hysteresis, relaxation and moments of the contact image",
        requires=channels,
        features=CURVE,
    )
    yield FeatureSetEntry(
        name="chitta-and-curve",
        target="graspsense_grasp_curve.features:ChittaAndCurve",
        config="graspsense_grasp_curve.features:GraspCurveConfig",
        summary="the six features of Table I and those of grasp-curve",
        requires=channels,
        features=(*SIX, *CURVE),
    )
