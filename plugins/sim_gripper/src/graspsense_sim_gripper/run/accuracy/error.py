"""The error of one simulated grasp compared with another. `gripper.accuracy` limits this error.

It is the largest error of the six features, of the peak force and of the force over time. The error of a feature or of
the peak is the difference, divided by the larger of its magnitude and a scale. The error of the force over time is the
root mean square of the difference, divided by that of the force or by 1 N, whichever is larger.

The features are those of Chitta, Piccoli and Sturm (ICRA 2010) with the mean of both forces, from ideal sensors. The
feature set `chitta` (graspsense.plugins.features) evaluates them at ticks. Here contact and rest are interpolated
between ticks, so that the error does not jump by a tick, and that code cannot be shared.
`test_they_are_the_feature_sets_own_to_a_tick` verifies that both agree to a tick.

The features that the pipeline extracts are compared too. A feature set reads values at ticks. Two grasps that differ by
a part of a tick may therefore differ in a feature by what it changes within a tick, however accurate both are. That
much is found by extracting from the same grasp sampled half a tick later, and does not count. Trial grasps have neither
cell images nor further signals. A feature set that needs them is not verified.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S, Features, FeatureSet
from graspsense.simulator_api import CHANNELS
from graspsense_sim_gripper.run.buffers import recorded_trace
from graspsense_sim_gripper.run.loop import COLUMNS, EVENT_SHIFT

UNIT_SCALES: Final = {
    "m": 1e-3,
    "s": 0.05,
    "m/s": 1e-3,
    "N": 1.0,
    "N/s": 1.0,
    "N/m": 1e3,
    "J": 1e-3,
}
"""The error of a quantity in this unit is relative to its magnitude, or to this if it is smaller."""
SCALES: Final = {
    name: UNIT_SCALES[unit]
    for name, unit in (
        ("p_first", "m"),
        ("p_steady", "m"),
        ("f_steady", "N"),
        ("delta_t", "s"),
        ("dp_dt", "m/s"),
        ("df_dt", "N/s"),
        ("peak", "N"),
    )
}
"""The scale of each quantity that is compared."""
TRACE_SCALE_N: Final = 1.0
"""The same for the root mean square of the force over time."""


@frozen(kw_only=True, eq=False)
class GraspRecord:
    """What is compared of a grasp: a row for each tick from the approach on, the outcome and the peak force."""

    outcome: int
    """The outcome as the control law numbers it; -1 if the guard stopped the grasp."""
    dt_s: float
    gap_m: NDArray[np.float64]
    speed_m_s: NDArray[np.float64]
    """Rate of the gap; closing is negative."""
    left_n: NDArray[np.float64]
    right_n: NDArray[np.float64]
    n_rows: int
    """Number of rows until the fingers open."""
    peak_n: float
    """The largest force on a pad, also between ticks."""
    hold_from: int = 0
    """The row with which the hold begins, or `n_rows` if there is none. A rest counts that lasts into the hold."""

    @cached_property
    def quantities(self) -> dict[str, float]:
        """The six features and the peak force, by the names of `SCALES`; NaN for an undefined feature."""
        values = dict.fromkeys(SCALES, math.nan)
        values["peak"] = self.peak_n
        touch = self._contact()
        if touch is None:
            return values
        values["p_first"] = _at(self.gap_m, touch)
        still = self._rest(touch)
        if still is None:
            return values
        steady, moved = still
        values["p_steady"] = _at(self.gap_m, steady)
        force = self.force_n
        values["f_steady"] = _at(force, max(steady + REST_WINDOW_S / self.dt_s, self._shown_from()))
        values["delta_t"] = (steady - touch) * self.dt_s
        if moved:
            values["dp_dt"] = (values["p_steady"] - values["p_first"]) / values["delta_t"]
            values["df_dt"] = (values["f_steady"] - _at(force, touch)) / values["delta_t"]
        return values

    @cached_property
    def force_n(self) -> NDArray[np.float64]:
        """The mean force of both pads."""
        return 0.5 * (self.left_n + self.right_n)

    def _shown_from(self) -> int:
        """Return the first row that can show a rest: that of the hold, or any if there is no hold."""
        return self.hold_from if self.hold_from < self.n_rows else 0

    def _contact(self) -> float | None:
        """Return the interpolated row at which both pads reach the contact force; None if they never do."""
        felt = np.minimum(self.left_n, self.right_n)[: self.n_rows] - CONTACT_FORCE_N
        over = np.flatnonzero(felt >= 0.0)
        if not len(over):
            return None
        i = int(over[0])
        return float(i) if i == 0 else i - float(felt[i] / (felt[i] - felt[i - 1]))

    def _rest(self, touch: float) -> tuple[float, bool] | None:
        """Return the interpolated row at which the fingers come to rest, and whether they moved since the contact.

        None if they do not rest for REST_WINDOW_S. The row of the contact does not count as motion, as in the feature
        set. Like there, a rest before the hold does not count if the fingers move again: the controller has waited for
        more than rest.
        """
        speed = np.abs(self.speed_m_s[: self.n_rows]) - REST_SPEED_M_S
        window = round(REST_WINDOW_S / self.dt_s)
        begin = math.ceil(touch)
        moving = np.concatenate(([begin - 1], begin + np.flatnonzero(speed[begin:] > 0.0), [self.n_rows]))
        rests = np.flatnonzero((np.diff(moving) > window) & (moving[1:] > self._shown_from()))
        if not len(rests):
            return None
        i = int(moving[rests[0]])
        stops = i + float(speed[i] / (speed[i] - speed[i + 1])) if speed[i] > 0.0 else touch
        return max(stops, touch), i >= begin


def _at(column: NDArray[np.float64], place: float) -> float:
    """Return the value of a column at a row with a fraction, by linear interpolation; at its ends beyond them."""
    i = min(max(math.floor(place), 0), len(column) - 1)
    lower, upper = float(column[i]), float(column[min(i + 1, len(column) - 1)])
    return lower + min(max(place - i, 0.0), 1.0) * (upper - lower)


def _rms(values: NDArray[np.float64]) -> float:
    return math.sqrt(float(values @ values) / len(values))


def deviation(grasp: GraspRecord, expected: GraspRecord) -> tuple[float, str]:
    """Return the largest relative error of all quantities, and the name of that quantity.

    The error is infinite if the outcomes differ, or if a feature is defined in one of the grasps only.
    """
    if grasp.outcome != expected.outcome:
        return math.inf, "outcome"
    errors = {}
    wanted = expected.quantities
    for name, value in grasp.quantities.items():
        if not (math.isnan(wanted[name]) and math.isnan(value)):
            errors[name] = abs(value - wanted[name]) / max(abs(wanted[name]), SCALES[name])
    n = min(len(grasp.gap_m), len(expected.gap_m))
    if n > 0:
        others = expected.force_n[:n]
        errors["trace"] = _rms(grasp.force_n[:n] - others) / max(_rms(others), TRACE_SCALE_N)
    worst, quantity = 0.0, "nothing"
    for name, error in errors.items():
        # `not <=` instead of `>`: NaN counts as the largest error.
        if not error <= worst:
            worst, quantity = (math.inf if math.isnan(error) else error), name
    return worst, quantity


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
