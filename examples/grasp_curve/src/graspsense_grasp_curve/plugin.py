"""What this distribution brings; numpy is imported when features are drawn."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import Channel, FeatureSetEntry, hookimpl

GRASPSENSE_API = (1, 0)

SIX = (
    ("p_first", "m"),
    ("p_steady", "m"),
    ("f_steady", "N"),
    ("delta_t", "s"),
    ("dp_dt", "m/s"),
    ("df_dt", "N/s"),
)
CURVE = (
    ("peak_force", "N"),
    ("gap_at_peak", "m"),
    ("stiffness_ratio", "1"),
    ("hysteresis", "1"),
    ("relaxation_time", "s"),
    ("contact_area", "cells"),
    ("contact_row", "rows"),
    ("contact_spread", "rows"),
)


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the eight alone, and with the six of Table I before them."""
    channels = (
        Channel("gap", "m"),
        Channel("force_left", "N"),
        Channel("force_right", "N"),
        Channel("pads", "counts"),
    )
    yield FeatureSetEntry(
        name="grasp-curve",
        target="graspsense_grasp_curve.features:GraspCurve",
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
