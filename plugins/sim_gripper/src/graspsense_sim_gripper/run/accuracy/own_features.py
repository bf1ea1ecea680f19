"""The features that a pipeline extracts from a grasp, and how far those of two models of it are apart.

A feature set reads values at ticks. Two grasps that differ by a part of a tick may therefore differ in a feature by
what it changes within a tick, however accurate both are. That much is found by extracting from the same grasp sampled
half a tick later, and does not count.

Trial grasps have neither cell images nor further signals. A feature set that needs them is not verified.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense.plugin_api import Features, FeatureSet
from graspsense.simulator_api import CHANNELS
from graspsense_sim_gripper.run.accuracy.error import UNIT_SCALES
from graspsense_sim_gripper.run.buffers import recorded_trace
from graspsense_sim_gripper.run.loop import COLUMNS, EVENT_SHIFT

HELD: Final = tuple(COLUMNS.index(name) for name in ("effort_n", "command"))
"""The columns that are constant within a tick."""
READ: Final = CHANNELS.keys() - {"pads"}
"""The channels of a trial grasp."""
NOT_READ: Final = ("features",)
"""What is not verified where the features cannot be extracted from a trial grasp."""
ROUNDING: Final = 1e-9
"""Difference of a feature, in its unit, below which it is rounding."""


class OwnFeatures(NamedTuple):
    """The features of one grasp."""

    features: Features
    later: Callable[[], Features]
    """Returns those of the same grasp, sampled half a tick later."""


def own_features(
    feature_set: FeatureSet[Any], table: NDArray[np.float64], phases: NDArray[np.float64]
) -> OwnFeatures | None:
    """Return the features of a grasp that ideal sensors read; None if the set needs further channels, or fails.

    `table`, shape (columns, n), and `phases`, shape (n,), are those of `loop.Buffers`.
    """
    # The entry of a set may declare the channels instead of its class.
    required = {channel.name for channel in getattr(feature_set, "requires", ())}
    if not required <= READ:
        return None
    numbers, none = phases.astype(np.int64) & ((1 << EVENT_SHIFT) - 1), np.zeros(0)

    def extracted(columns: NDArray[np.float64]) -> Features:
        return feature_set.extract(recorded_trace((), columns, numbers.copy(), none, none))

    try:
        features = extracted(table)
    except Exception:
        # A set that fails on every grasp is reported where the grasp itself is extracted from.
        return None
    if not isinstance(features, Features):
        return None
    return OwnFeatures(features, lambda: extracted(_half_a_tick_later(table)))


def _half_a_tick_later(table: NDArray[np.float64]) -> NDArray[np.float64]:
    later = np.array(table)
    later[:, :-1] = 0.5 * (table[:, :-1] + table[:, 1:])
    later[list(HELD)] = table[list(HELD)]
    later[0] = table[0] + 0.5 * (table[0, 1] - table[0, 0] if table.shape[1] > 1 else 0.0)
    return later


def beyond(grasp: OwnFeatures | None, expected: OwnFeatures | None, accuracy: float) -> tuple[str, ...]:
    """Return the names of the features of a grasp that differ from the expected ones by more than `accuracy`.

    `NOT_READ` if one of the grasps has no features. A feature without a value in both grasps does not differ. The
    difference is relative to the magnitude, or to the scale of the unit (`error.UNIT_SCALES`) if that is larger.
    """
    if grasp is None or expected is None:
        return NOT_READ
    try:
        half_later = expected.later()
    except Exception:
        return NOT_READ
    names, values = expected.features.names, expected.features.values
    values_by_name, later = (
        dict(zip(extracted.names, extracted.values, strict=True))
        for extracted in (grasp.features, half_later)
    )
    return tuple(
        name
        for name, value, unit in zip(names, values, expected.features.units, strict=True)
        if _differs(values_by_name[name], value, later[name], accuracy, UNIT_SCALES.get(unit, 0.0))
    )


def _differs(measured: float, value: float, later: float, accuracy: float, scale: float) -> bool:
    if math.isnan(value) != math.isnan(later):
        # Within half a tick of not being defined, or of being.
        return False
    if math.isnan(value) or math.isnan(measured):
        return math.isnan(value) != math.isnan(measured)
    allowed = accuracy * max(abs(value), scale) + 2.0 * abs(later - value) + ROUNDING
    return abs(measured - value) > allowed
