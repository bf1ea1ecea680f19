"""The posterior predictive check: new simulated squeezes beside the recorded ones.

Each simulated set has as many squeezes as were recorded. Its parameters are a draw of the identified ones, its objects
and placements are drawn from the spreads, and it follows the recorded paths of the gap. The p-value of a statistic is
that of the mean over a set.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.simulator_api import PredictiveCheck
from graspsense_identify.fit import Fitted
from graspsense_identify.prepare import Squeeze
from graspsense_identify.spread import Uncertainty

Floats = NDArray[np.float64]

SETS: Final = 60
MAX_SQUEEZES: Final = 10
STATISTICS: Final = (
    ("peak force", "N"),
    ("work until the peak", "mJ"),
    ("force at the end over the peak", ""),
)


def predictive_checks(fitted: Fitted, intervals: Uncertainty) -> tuple[PredictiveCheck, ...]:
    """Return a check of each statistic."""
    rng = np.random.default_rng(1)
    used = list(fitted.squeezes[:MAX_SQUEEZES])
    recorded = np.array([_statistics(squeeze, squeeze.force_n) for squeeze in used])
    spread = intervals.stiffness.whole
    means, every = [], []
    for draw in intervals.draws[:SETS]:
        rows = []
        for squeeze, width, factor in zip(used, fitted.widths_m, fitted.factors, strict=False):
            own = math.exp(spread * rng.standard_normal()) if len(used) > 1 else factor
            forces = fitted.model.forces(squeeze, fitted.candidate, draw.tolist(), width, own)
            noisy = forces + fitted.rms * squeeze.peak_n * rng.standard_normal(len(forces))
            rows.append(_statistics(squeeze, noisy))
        means.append(np.mean(rows, axis=0))
        every.append(rows)
    p_values = np.mean(np.asarray(means) >= recorded.mean(axis=0), axis=0)
    simulated = np.array(every).reshape(-1, len(STATISTICS))
    return tuple(
        PredictiveCheck(
            statistic=name,
            unit=unit,
            recorded=tuple(recorded[:, k].tolist()),
            simulated=tuple(simulated[:, k].tolist()),
            p=float(p_values[k]),
        )
        for k, (name, unit) in enumerate(STATISTICS)
    )


def _statistics(squeeze: Squeeze, force_n: Floats) -> tuple[float, float, float]:
    """Return peak force, work (mJ) until the gap is smallest, and the force there at the end of the hold, relative."""
    gap = squeeze.gap_m[squeeze.sample]
    peak = int(np.argmax(force_n))
    held = np.flatnonzero(gap < np.min(gap) + 0.03 * squeeze.depth_m)
    return float(force_n[peak]), 1e3 * squeeze.work_j(force_n), float(force_n[int(held[-1])] / force_n[peak])
