"""The component of this distribution. numpy is imported when features are extracted."""

from __future__ import annotations

from collections.abc import Iterable

from graspsense.plugin_api import FeatureSetEntry, hookimpl

GRASPSENSE_API = (2, 0)


@hookimpl
def graspsense_feature_sets() -> Iterable[FeatureSetEntry]:
    """Return the set of the eight features."""
    yield FeatureSetEntry(
        name="grasp-curve",
        target="graspsense_grasp_curve.features:GraspCurveFeatures",
        summary="peak, stiffness ratio, hysteresis, relaxation and moments of the contact image",
    )
