"""How well the identified object predicts squeezes.

Of a recording that is held out nothing was used: the object is fitted to the others. It has only a width of its own,
which is where the object stands between the fingers: a sensor of 24 Hz shows it to some 0.4 mm. Its stiffness is the
mean of the others.

The posterior predictive check puts new simulated squeezes beside the recorded ones. Each simulated set has as many
squeezes as were recorded. Its parameters are a draw of the identified ones, its objects and placements are drawn from
the spreads, and it follows the recorded paths of the gap. The p-value of a statistic is that of the mean over a set.
"""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.simulator_api import PredictiveCheck
from graspsense_identify.fit import FACTOR_RANGE, STEP, TOLERANCE, WIDTH_RANGE, Fitted, in_threads, relative
from graspsense_identify.prepare import Squeeze
from graspsense_identify.spread import Uncertainty

MAX_FOLDS: Final = 5
CONFIRMS: Final = 0.1
"""A held-out squeeze that is predicted to this share of its peak confirms the object, and so does one that is predicted
as closely as the squeezes are alike (`repeatability`)."""


def held_out_errors(fitted: Fitted, *, own_stiffness: bool = False) -> tuple[float, ...]:
    """Return the rms error over the peak of each squeeze, predicted from others; nothing for a single squeeze.

    `own_stiffness`: whether a held-out squeeze has a factor of its own on the stiffness, too.
    """
    n = len(fitted.squeezes)
    folds = min(n, MAX_FOLDS)
    if n < 2:
        return ()

    def of_fold(k: int) -> list[float]:
        train = fitted.part([i for i in range(n) if i % folds != k]).refitted()
        beyond_m = float(np.mean(np.array(train.widths_m) - [squeeze.width_m for squeeze in train.squeezes]))
        # With a stiffness of its own, a width far from that of the fit may lead to another minimum.
        widths_m = fitted.widths_m if own_stiffness else [own.width_m + beyond_m for own in fitted.squeezes]
        return [
            _predicted_rms(train, fitted.squeezes[i], widths_m[i], own_stiffness) for i in range(k, n, folds)
        ]

    of_folds = in_threads(of_fold, range(folds))
    return tuple(of_folds[i % folds][i // folds] for i in range(n))


def _predicted_rms(fitted: Fitted, squeeze: Squeeze, width_m: float, own_stiffness: bool) -> float:
    """Return the rms residual over the peak of a squeeze that was not fitted. `width_m`: the width to start from."""
    from scipy.optimize import least_squares

    def residuals(x: NDArray[np.float64]) -> NDArray[np.float64]:
        factor = math.exp(x[1]) if own_stiffness else 1.0
        width = width_m + x[0] * squeeze.depth_m
        forces = fitted.model.forces(squeeze, fitted.candidate, fitted.values, width, factor)
        return relative(forces - squeeze.force_n, squeeze.peak_n)

    limits = np.array([WIDTH_RANGE, FACTOR_RANGE][: 1 + own_stiffness])
    start, steps = np.zeros(len(limits)), [STEP] * len(limits)
    solution = least_squares(
        residuals, start, bounds=(-limits, limits), max_nfev=15, diff_step=steps, ftol=TOLERANCE
    )
    return float(np.sqrt(np.mean(solution.fun**2)))


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
