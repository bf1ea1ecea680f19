"""How far one simulated grasp is from another: the error that an accuracy is asked of.

Of the six features, the peak force and the force's trace. The error of a quantity is its difference over the larger
of its size and a scale; that of the trace is the root of the mean square of the difference, over that of the trace or
a newton. Instants are located inside the tick, so that a grasp is not as good as its clock is fine. The features are
those of Chitta, Piccoli and Sturm (ICRA 2010) with the mean of both forces, from ideal sensors.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any, Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.plugin_api import CONTACT_FORCE_N, REST_SPEED_M_S, REST_WINDOW_S

SCALES: Final = {
    "p_first": 1e-3,
    "p_steady": 1e-3,
    "f_steady": 1.0,
    "delta_t": 0.05,
    "dp_dt": 1e-3,
    "df_dt": 1.0,
    "peak": 1.0,
}
"""Below these (m, m, N, s, m/s, N/s, N) an error counts as if the quantity were this."""
TRACE_SCALE_N: Final = 1.0


@frozen(kw_only=True, eq=False)
class GraspRecord:
    """What a grasp is compared by: a row a tick from the approach on, how it ended, and the true peak force."""

    outcome: int
    dt_s: float
    gap_m: NDArray[np.float64]
    speed_m_s: NDArray[np.float64]
    left_n: NDArray[np.float64]
    right_n: NDArray[np.float64]
    n_rows: int
    """How many rows there are until the fingers open."""
    peak_n: float

    def quantities(self) -> dict[str, float]:
        """Return the features and the peak force; NaN for what this grasp does not have."""
        found = dict.fromkeys(SCALES, math.nan)
        found["peak"] = self.peak_n
        first = self._touch()
        if first is None:
            return found
        found["p_first"] = _at(self.gap_m, first)
        rest = self._rest(first)
        if rest is None:
            return found
        steady, moved = rest
        found["p_steady"] = _at(self.gap_m, steady)
        force = 0.5 * (self.left_n + self.right_n)
        found["f_steady"] = _at(force, steady + REST_WINDOW_S / self.dt_s)
        found["delta_t"] = (steady - first) * self.dt_s
        if moved:
            found["dp_dt"] = (found["p_steady"] - found["p_first"]) / found["delta_t"]
            found["df_dt"] = (found["f_steady"] - _at(force, first)) / found["delta_t"]
        return found

    def contact_speed_m_s(self) -> float:
        """Return how fast the gap closed when a pad first felt anything; 0 where none did."""
        felt = np.flatnonzero(np.maximum(self.left_n, self.right_n) > 0.0)
        return float(-self.speed_m_s[max(int(felt[0]) - 1, 0)]) if len(felt) else 0.0

    def _touch(self) -> float | None:
        """Return the row, and the part of one, at which both pads feel the contact force."""
        felt = np.minimum(self.left_n, self.right_n)[: self.n_rows] - CONTACT_FORCE_N
        over = np.flatnonzero(felt >= 0.0)
        if not len(over):
            return None
        i = int(over[0])
        return float(i) if i == 0 else i - float(felt[i] / (felt[i] - felt[i - 1]))

    def _rest(self, first: float) -> tuple[float, bool] | None:
        """Return from where on the speed stays below that of rest, and whether there was motion in between.

        In the very row of the contact there is no rate, as the feature set has it.
        """
        speed = np.abs(self.speed_m_s[: self.n_rows]) - REST_SPEED_M_S
        window = round(REST_WINDOW_S / self.dt_s)
        begin = math.ceil(first)
        moving = [begin - 1, *(np.flatnonzero(speed[begin:] > 0.0) + begin).tolist(), self.n_rows]
        for i, following in pairwise(moving):
            if following - i > window:
                stops = i + float(speed[i] / (speed[i] - speed[i + 1])) if speed[i] > 0.0 else first
                return max(stops, first), i >= begin
        return None


def _at(column: Any, place: float) -> float:
    return float(np.interp(place, np.arange(len(column)), column))


def deviation(one: GraspRecord, expected: GraspRecord) -> tuple[float, str]:
    """Return the largest error of all, and which quantity it is of; infinite where they are not of one kind."""
    if one.outcome != expected.outcome:
        return math.inf, "outcome"
    worst, whose = 0.0, "nothing"
    wanted = expected.quantities()
    for name, value in one.quantities().items():
        if math.isnan(wanted[name]) and math.isnan(value):
            continue
        error = abs(value - wanted[name]) / max(abs(wanted[name]), SCALES[name])
        if not error <= worst:
            worst, whose = (math.inf if math.isnan(error) else error), name
    n = min(len(one.gap_m), len(expected.gap_m))
    if n == 0:
        return worst, whose
    mine, other = (0.5 * (record.left_n[:n] + record.right_n[:n]) for record in (one, expected))
    trace = float(np.sqrt(np.mean((mine - other) ** 2)) / max(np.sqrt(np.mean(other**2)), TRACE_SCALE_N))
    if not trace <= worst:
        worst, whose = (math.inf if math.isnan(trace) else trace), "trace"
    return worst, whose
