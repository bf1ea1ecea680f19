"""The fit of a candidate to several squeezes at once, by bounded least squares.

The parameters of the object are common to all squeezes. Each squeeze has its own width and its own factor on the
stiffness, since instances and placements differ: these are the spreads of a scene. Residuals are relative to the peak
of their squeeze, so that every squeeze has the same weight.

The logarithms of the factors have a sum of zero: the common stiffness is the mean. They are combinations of contrasts,
each of which has that sum, so that every fit has it exactly.

The Jacobian is computed by differences of the logarithms. A width or a factor acts on its own squeeze only, so one
evaluation of all squeezes gives the derivatives with respect to all widths. The time by which the force lags behind the
gap is common to all squeezes, where it is fitted.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense_identify.forward import ForwardModel, Runs
from graspsense_identify.laws import CandidateLaw
from graspsense_identify.prepare import MAX_LAG_S, Squeeze

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP: Final = 1e-5
"""Difference of the logarithms in the Jacobian."""
WIDTH_STEP_SHARE: Final = 1e-5
"""Difference of the width in the Jacobian, as a share of the compression."""
FACTOR_RANGE: Final = math.log(10.0)
"""Of the logarithms of the factors, by which the stiffness of a squeeze differs from the mean."""
WIDTH_RANGE: Final = 0.7
"""The width may differ from the first estimate by this share of the compression."""
NO_FORCE: Final = 10.0
"""Relative residual where a law gives no finite force."""
LARGEST_RESIDUAL: Final = 1e6
"""Relative residuals of a law far from the data, whose squares would overflow."""
LAG_UNIT_S: Final = 0.01
"""Unit of the lag of the force in the vector of a fit."""
LAG_STEP: Final = 0.1
"""Difference of the lag in the Jacobian, in these units, to both sides: where a measurement passes the contact, the
derivative jumps."""
LAG_STARTS: Final = (0.0, 0.5, -0.5)
"""Lags to start from, in these units."""
LEAST_ERROR: Final = 1e-3
"""Errors below this share of the peak are those of the path's nodes: they tell no candidates apart."""
MAX_EVALUATIONS: Final = 40
"""Of one start. Where two parameters nearly do the same, the minimum is a flat valley, and a fit ends on its way."""
TOLERANCE: Final = 1e-6
SMALLEST_SINGULAR: Final = 1e-9
"""Of the Jacobian with columns of length 1: below this, a change of the parameters changes no force."""
STARTS: Final = 3
"""The best starts, which are optimised."""


@frozen(kw_only=True, eq=False)
class Fitted:
    """The result of a fit."""

    candidate: CandidateLaw
    values: tuple[float, ...]
    """Of the free parameters of the candidate."""
    widths_m: tuple[float, ...]
    factors: tuple[float, ...]
    """On the stiffness of each squeeze."""
    cost: float
    residuals: Floats
    """Relative to the peak of each squeeze."""
    lag_s: float = 0.0
    """By how much the force lags behind the gap, beyond the times of the squeezes; 0 where it was not fitted."""
    lag_error_s: float = math.nan
    """Its standard deviation, by the linearised fit."""

    @property
    def rms(self) -> float:
        """The rms residual over the peak."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def parameters(self) -> int:
        """The number of its free parameters, the lag included."""
        return len(self.values) + int(math.isfinite(self.lag_error_s))

    def at_bound(self, i: int) -> bool:
        """Whether a value is at an end of its range."""
        parameter = self.candidate.free[i]
        return not 1.02 * parameter.low < self.values[i] < parameter.high / 1.02


class _Problem:
    """The residuals and their Jacobian as functions of one vector."""

    def __init__(
        self,
        model: ForwardModel,
        candidate: CandidateLaw,
        squeezes: Sequence[Squeeze],
        masks: Sequence[Mask],
        *,
        has_lag: bool,
    ) -> None:
        self.model, self.candidate, self.squeezes = model, candidate, squeezes
        self.has_lag = has_lag
        self.p, self.n = len(candidate.free), len(squeezes)
        self.contrasts = contrasts(self.n)
        self.paths = model.paths(squeezes)
        self.first_widths = np.array([squeeze.width_m for squeeze in squeezes])
        self.depths = np.array([squeeze.depth_m for squeeze in squeezes])
        sizes = [int(mask.sum()) for mask in masks]
        self.size = sum(sizes)
        self.of_squeeze = np.repeat(np.arange(self.n), sizes)
        kept = list(zip(squeezes, masks, strict=True))
        self.masks = masks
        self.measured = np.concatenate([squeeze.force_n[mask] for squeeze, mask in kept])
        self.peaks = np.repeat([squeeze.peak_n for squeeze in squeezes], sizes)
        self._last: tuple[Floats, Floats] | None = None
        """The last vector, and its residuals."""

    def bounds(self) -> tuple[Floats, Floats]:
        low = [math.log(parameter.low) for parameter in self.candidate.free]
        high = [math.log(parameter.high) for parameter in self.candidate.free]
        wide = [WIDTH_RANGE] * self.n
        factors = [FACTOR_RANGE] * (self.n - 1)
        lag = [MAX_LAG_S / LAG_UNIT_S] if self.has_lag else []
        return (
            np.array([*low, *(-factor for factor in (*wide, *factors, *lag))]),
            np.array([*high, *wide, *factors, *lag]),
        )

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the values, widths and factors of a vector, or of each row of a table."""
        p, n = self.p, self.n
        widths = self.first_widths + x[..., p : p + n] * self.depths
        factors = np.exp(x[..., p + n : p + 2 * n - 1] @ self.contrasts.T)
        return np.exp(x[..., :p]), widths, factors

    def vector(self, fitted: Fitted) -> Floats:
        """Return the vector of a fit to these squeezes, without its lag."""
        shares = [
            (width - squeeze.width_m) / squeeze.depth_m
            for width, squeeze in zip(fitted.widths_m, self.squeezes, strict=True)
        ]
        factors = np.log(fitted.factors)
        is_stiffness = np.array([parameter.is_stiffness for parameter in fitted.candidate.free])
        values = np.log(fitted.values) + float(np.mean(factors)) * is_stiffness
        return np.concatenate([values, shares, factors @ self.contrasts])

    def lags_s(self, x: Floats) -> Floats:
        """Return the lag of a vector, or of each row of a table."""
        lags: Floats = LAG_UNIT_S * x[..., -1] if self.has_lag else np.zeros(x.shape[:-1])
        return lags

    def of_all(self, xs: Floats) -> Floats:
        """Return the residuals of each row of a table of vectors."""
        return self._at(xs, *self.split(xs))

    def _at(self, xs: Floats, values: Floats, widths: Floats, factors: Floats) -> Floats:
        """Return the residuals with these values, widths and factors, and the lags of the vectors."""
        numbers = self.candidate.numbers(np.repeat(values, self.n, axis=0), factors.ravel())
        lags, which = np.unique(self.lags_s(xs), return_inverse=True)
        paths = self.paths
        if self.has_lag:
            paths = self.model.paths(
                [squeeze.delayed(lag) for lag in lags.tolist() for squeeze in self.squeezes]
            )
        path = (self.n * which.reshape(-1, 1) + np.arange(self.n)).ravel()
        forces = self.model.run(paths, Runs(path, widths.ravel(), numbers, self.candidate.active))
        by_vector = forces.reshape(len(xs), self.n, -1)
        samples = [
            squeeze.at_samples(by_vector[:, i, : len(squeeze.t_s)])[:, self.masks[i]]
            for i, squeeze in enumerate(self.squeezes)
        ]
        return _relative(np.concatenate(samples, axis=1) - self.measured, self.peaks)

    def residuals(self, x: Floats) -> Floats:
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.of_all(x[np.newaxis])[0]
        return self._last[1]

    def jacobian(self, x: Floats) -> Floats:
        here, p, n = self.residuals(x), self.p, self.n
        moved = np.tile(x, (p + 2 + 2 * self.has_lag, 1))
        moved[range(p), range(p)] += STEP
        moved[p, p : p + n] += WIDTH_STEP_SHARE
        if self.has_lag:
            moved[-2:, -1] += (-LAG_STEP, LAG_STEP)
        values, widths, factors = self.split(moved)
        factors[p + 1] *= math.exp(STEP)
        there = self._at(moved, values, widths, factors)
        out = np.zeros((self.size, len(x)))
        out[:, :p] = ((there[:p] - here) / STEP).T
        out[np.arange(self.size), p + self.of_squeeze] = (there[p] - here) / WIDTH_STEP_SHARE
        by_factor = (there[p + 1] - here) / STEP
        out[:, p + n : p + 2 * n - 1] = by_factor[:, np.newaxis] * self.contrasts[self.of_squeeze]
        if self.has_lag:
            out[:, -1] = (there[-1] - there[-2]) / (2.0 * LAG_STEP)
        return out


def contrasts(n: int) -> Floats:
    """Return n - 1 orthonormal columns, each with the sum zero (Helmert)."""
    from scipy.linalg import helmert

    columns: Floats = helmert(n).T
    return columns


def whole(squeezes: Sequence[Squeeze]) -> list[Mask]:
    """Return the masks that use every sample."""
    return [np.ones(len(squeeze.force_n), dtype=np.bool_) for squeeze in squeezes]


def fit(
    model: ForwardModel,
    candidate: CandidateLaw,
    squeezes: Sequence[Squeeze],
    masks: Sequence[Mask] | None = None,
    start: Fitted | None = None,
    *,
    has_lag: bool = False,
    max_evaluations: int = MAX_EVALUATIONS,
) -> Fitted:
    """Return the best fit of a candidate to these squeezes, from the best of its starts, or from another fit.

    `masks`: the samples that count. `start`: a fit of the same candidate to the same squeezes. `has_lag`: whether the
    lag of the force is fitted, too.
    """
    from scipy.optimize import least_squares

    used = whole(squeezes) if masks is None else masks
    problem = _Problem(model, candidate, squeezes, used, has_lag=has_lag)
    low, high = problem.bounds()
    best = None
    for x0 in _starts(problem, start):
        x0 = np.clip(x0, low + 1e-9, high - 1e-9)
        solution = least_squares(
            problem.residuals,
            x0,
            problem.jacobian,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=max_evaluations,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
        )
        if best is None or solution.cost < best.cost:
            best = solution
    assert best is not None
    values, widths, factors = problem.split(best.x)
    return Fitted(
        candidate=candidate,
        values=tuple(values.tolist()),
        widths_m=tuple(widths.tolist()),
        factors=tuple(factors.tolist()),
        cost=float(best.cost),
        residuals=best.fun,
        lag_s=float(problem.lags_s(best.x)),
        lag_error_s=_lag_error_s(np.asarray(best.jac), best.fun) if has_lag else math.nan,
    )


def fit_to(
    model: ForwardModel,
    fitted: Fitted,
    squeezes: Sequence[Squeeze],
    kept: Sequence[int],
    *,
    has_lag: bool = False,
) -> Fitted:
    """Return the fit to some of the squeezes of another fit, whose stiffness is that of the mean of these."""
    start = evolve(
        fitted,
        widths_m=tuple(fitted.widths_m[i] for i in kept),
        factors=tuple(fitted.factors[i] for i in kept),
    )
    return fit(model, fitted.candidate, [squeezes[i] for i in kept], start=start, has_lag=has_lag)


def linear_covariance(
    model: ForwardModel, fitted: Fitted, squeezes: Sequence[Squeeze], least_error: float
) -> Floats:
    """Return the covariance of the logarithms of the values that the residuals leave, by the linearised fit.

    It is that of the values with a common stiffness which is the mean of the squeezes. `least_error`: by how much the
    forces of the model are wrong at least, over the peak. A direction that changes no force has a large variance.
    """
    problem = _Problem(model, fitted.candidate, squeezes, whole(squeezes), has_lag=False)
    jacobian = problem.jacobian(problem.vector(fitted))
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    # The fit follows a part of the residuals' own errors, with as many directions as it has parameters.
    degrees = max(problem.size - jacobian.shape[1], 1)
    error = math.hypot(fitted.rms * math.sqrt(problem.size / degrees), least_error)
    root = (rows.T / np.maximum(singular, SMALLEST_SINGULAR) * error) / scale[:, np.newaxis]
    covariance: Floats = (root @ root.T)[: problem.p, : problem.p]
    return covariance


def _lag_error_s(jacobian: Floats, residuals: Floats) -> float:
    """Return the standard deviation of the lag: that of the residuals over what only a lag does to the forces."""
    others, lag = jacobian[:, :-1], jacobian[:, -1]
    scale = np.maximum(np.linalg.norm(others, axis=0), 1e-12)
    mimicked, *_ = np.linalg.lstsq(others / scale, lag, rcond=1e-9)
    alone = float(np.linalg.norm(lag - others / scale @ mimicked))
    error = math.hypot(float(np.sqrt(np.mean(residuals**2))), LEAST_ERROR)
    return LAG_UNIT_S * error / max(alone, 1e-12)


def _relative(errors: Floats, peaks_n: Floats | float) -> Floats:
    """Return errors of forces over the peak, all of them finite."""
    finite = np.nan_to_num(errors / peaks_n, nan=NO_FORCE, posinf=NO_FORCE, neginf=-NO_FORCE)
    return np.clip(finite, -LARGEST_RESIDUAL, LARGEST_RESIDUAL)


def held_out_rms(
    model: ForwardModel, fitted: Fitted, squeeze: Squeeze, width_m: float, *, own_stiffness: bool
) -> float:
    """Return the rms residual over the peak of a squeeze that was not fitted, with a width of its own.

    `width_m`: the width to start from. `own_stiffness`: whether it has a factor of its own on the stiffness, too.
    """
    from scipy.optimize import least_squares

    def residuals(x: Floats) -> Floats:
        factor = math.exp(x[1]) if own_stiffness else 1.0
        width = width_m + x[0] * squeeze.depth_m
        forces = model.forces(squeeze, fitted.candidate, fitted.values, width, factor)
        return _relative(forces - squeeze.force_n, squeeze.peak_n)

    limits = np.array([WIDTH_RANGE, FACTOR_RANGE][: 1 + own_stiffness])
    start, steps = np.zeros(len(limits)), [STEP] * len(limits)
    solution = least_squares(
        residuals, start, bounds=(-limits, limits), max_nfev=15, diff_step=steps, ftol=TOLERANCE
    )
    return float(np.sqrt(np.mean(solution.fun**2)))


def _starts(problem: _Problem, start: Fitted | None) -> list[Floats]:
    """Return the vectors to start from: that of another fit, or the best of the candidate's own."""
    own = np.zeros(2 * problem.n - 1 + int(problem.has_lag))
    if start is not None:
        known = problem.vector(start)
        if not problem.has_lag:
            return [known]
        lags = LAG_STARTS if start.lag_s == 0.0 else (start.lag_s / LAG_UNIT_S,)
        return [np.append(known, lag) for lag in lags]
    law = problem.candidate
    vectors = [np.concatenate([np.log(values), own]) for values in law.starts()]
    if len(vectors) > STARTS:
        costs = np.sum(problem.of_all(np.array(vectors)) ** 2, axis=1)
        vectors = [vectors[int(k)] for k in np.argsort(costs)[:STARTS]]
    for point in law.more_starts:
        wider = point.wider_m / problem.depths
        vectors.append(np.concatenate([np.log(point.values), wider, own[problem.n :]]))
    return vectors
