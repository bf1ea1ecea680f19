"""The fit of a candidate to several squeezes at once, by bounded least squares.

The parameters of the object are common to all squeezes. Each squeeze has its own width and its own factor on the
stiffness, since instances and placements differ: these are the spreads of a scene. Residuals are relative to the peak
of their squeeze, so that every squeeze has the same weight.

The logarithms of the factors have a sum of zero: the common stiffness is the mean. They are combinations of contrasts,
each of which has that sum, so that every fit has it exactly.

The Jacobian is computed by differences of the logarithms. A width or a factor acts on its own squeeze only. The time by
which the force lags behind the gap is common to all squeezes, where it is fitted.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NamedTuple, TypeVar

import numpy as np
from attrs import evolve, frozen
from numpy.typing import NDArray

from graspsense_identify.forward import ForwardModel
from graspsense_identify.laws import CandidateLaw
from graspsense_identify.prepare import MAX_LAG_S, Squeeze

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def in_threads(
    function: Callable[[ItemT], ResultT], items: Sequence[ItemT], done: Callable[[], None] = lambda: None
) -> list[ResultT]:
    """Return the results in the order of the items; `done` is called after each, in this thread."""
    from threadpoolctl import threadpool_limits

    results = []
    # Each fit is on one core. Threads of the linear algebra inside it would wait for each other most of the time.
    with threadpool_limits(1, "blas"), ThreadPoolExecutor(max_workers=os.cpu_count() or 1) as pool:
        for result in pool.map(function, items):
            results.append(result)
            done()
    return results


Floats = NDArray[np.float64]

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
    """A fit: the candidate and its values, and the squeezes that it was fitted to."""

    model: ForwardModel
    candidate: CandidateLaw
    squeezes: Sequence[Squeeze]
    values: tuple[float, ...]
    """Of the free parameters of the candidate."""
    widths_m: tuple[float, ...]
    factors: tuple[float, ...]
    """On the stiffness of each squeeze."""
    residuals: Floats
    """Relative to the peak of each squeeze."""
    lag_s: float = 0.0
    """By how much the force lags behind the gap, beyond the times of the squeezes; 0 where it was not fitted."""
    has_lag: bool = False
    """Whether it was fitted."""

    @property
    def rms(self) -> float:
        """The rms residual over the peak."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    @property
    def error(self) -> float:
        """The rms residual, in which those below `LEAST_ERROR` hardly differ."""
        return math.hypot(self.rms, LEAST_ERROR)

    @property
    def information(self) -> float:
        """Half of the Bayesian information criterion, less a constant: smaller is better."""
        return information(self.rms, len(self.values) + int(self.has_lag), len(self.residuals))

    @property
    def by_label(self) -> dict[str, float]:
        """The values by the labels of their parameters."""
        return {
            parameter.label: value for parameter, value in zip(self.candidate.free, self.values, strict=True)
        }

    def at_bound(self, i: int) -> bool:
        """Whether a value is at an end of its range."""
        parameter = self.candidate.free[i]
        return not 1.02 * parameter.low < self.values[i] < parameter.high / 1.02

    def forces(self) -> list[Floats]:
        """Return the forces (N) at the samples of each squeeze."""
        return [
            self.model.forces(squeeze.delayed(self.lag_s), self.candidate, self.values, width, factor)
            for squeeze, width, factor in zip(self.squeezes, self.widths_m, self.factors, strict=True)
        ]

    def part(self, kept: Sequence[int]) -> Fitted:
        """Return this fit with some of the squeezes, which another one may start from."""
        return evolve(
            self,
            squeezes=[self.squeezes[i] for i in kept],
            widths_m=tuple(self.widths_m[i] for i in kept),
            factors=tuple(self.factors[i] for i in kept),
        )

    def refitted(self, *, has_lag: bool = False, max_evaluations: int = MAX_EVALUATIONS) -> Fitted:
        """Return the best fit of the candidate to these squeezes from here on. `has_lag`: whether a lag is fitted, too.

        The common stiffness of the result is the mean of these squeezes.
        """
        problem = _Problem(self.model, self.candidate, self.squeezes, has_lag=has_lag)
        return problem.solved([problem.vector(self)], max_evaluations)


def information(rms: float, parameters: int, n: int) -> float:
    """Return half of the Bayesian information criterion of a fit to `n` residuals with this rms, less a constant."""
    return n * math.log(math.hypot(rms, LEAST_ERROR)) + 0.5 * parameters * math.log(n)


def fit(model: ForwardModel, candidate: CandidateLaw, squeezes: Sequence[Squeeze]) -> Fitted:
    """Return the best fit of a candidate to these squeezes, from the best of its starts."""
    problem = _Problem(model, candidate, squeezes)
    zeros = np.zeros(2 * problem.n - 1)
    vectors = [np.concatenate([np.log(values), zeros]) for values in candidate.starts()]
    if len(vectors) > STARTS:
        costs = [np.sum(problem.residuals(vector) ** 2) for vector in vectors]
        vectors = [vectors[int(k)] for k in np.argsort(costs)[:STARTS]]
    vectors += [np.concatenate([np.log(values), zeros]) for values in candidate.more_starts]
    return problem.solved(vectors)


class _Point(NamedTuple):
    values: Floats
    widths_m: Floats
    factors: Floats
    lag_s: float


class _Problem:
    """The residuals and their Jacobian as functions of one vector."""

    def __init__(
        self,
        model: ForwardModel,
        candidate: CandidateLaw,
        squeezes: Sequence[Squeeze],
        *,
        has_lag: bool = False,
    ) -> None:
        from scipy.linalg import helmert

        self.model, self.candidate, self.squeezes, self.has_lag = model, candidate, squeezes, has_lag
        self.p, self.n = len(candidate.free), len(squeezes)
        self.contrasts: Floats = helmert(self.n).T
        self.first_widths = np.array([squeeze.width_m for squeeze in squeezes])
        self.depths = np.array([squeeze.depth_m for squeeze in squeezes])
        self._last: tuple[Floats, Floats] | None = None
        """The last vector, and its residuals."""

    def bounds(self) -> tuple[Floats, Floats]:
        p = self.candidate.free
        both = (
            [WIDTH_RANGE] * self.n + [FACTOR_RANGE] * (self.n - 1) + [MAX_LAG_S / LAG_UNIT_S] * self.has_lag
        )
        low = [*(math.log(parameter.low) for parameter in p), *(-limit for limit in both)]
        return np.array(low), np.array([*(math.log(parameter.high) for parameter in p), *both])

    def point(self, x: Floats) -> _Point:
        """Return the values, widths, factors and lag of a vector."""
        p, n = self.p, self.n
        widths = self.first_widths + x[p : p + n] * self.depths
        factors = np.exp(self.contrasts @ x[p + n : p + 2 * n - 1])
        return _Point(np.exp(x[:p]), widths, factors, LAG_UNIT_S * float(x[-1]) if self.has_lag else 0.0)

    def vector(self, fitted: Fitted) -> Floats:
        """Return the vector of a fit to these squeezes."""
        shares = (np.array(fitted.widths_m) - self.first_widths) / self.depths
        factors = np.log(fitted.factors)
        is_stiffness = np.array([parameter.is_stiffness for parameter in fitted.candidate.free])
        values = np.log(fitted.values) + float(np.mean(factors)) * is_stiffness
        return np.concatenate(
            [values, shares, factors @ self.contrasts, [fitted.lag_s / LAG_UNIT_S] * self.has_lag]
        )

    def _of_squeeze(self, squeeze: Squeeze, points: Sequence[tuple[Floats, float, float]]) -> Floats:
        """Return the residuals of a squeeze at these values, widths and factors, a row for each."""
        forces = [self.model.at_nodes(squeeze, self.candidate, *point) for point in points]
        return relative(np.array(forces)[:, squeeze.sample] - squeeze.force_n, squeeze.peak_n)

    def residuals(self, x: Floats) -> Floats:
        if self._last is None or not np.array_equal(self._last[0], x):
            values, widths, factors, lag_s = self.point(x)
            rows = [
                self._of_squeeze(squeeze.delayed(lag_s), [(values, width, factor)])[0]
                for squeeze, width, factor in zip(self.squeezes, widths, factors, strict=True)
            ]
            self._last = x.copy(), np.concatenate(rows)
        return self._last[1]

    def jacobian(self, x: Floats) -> Floats:
        p, n = self.p, self.n
        values, widths, factors, lag_s = self.point(x)
        moved = np.exp(x[:p] + STEP * np.eye(p))
        sizes = [len(squeeze.force_n) for squeeze in self.squeezes]
        here = np.split(self.residuals(x), np.cumsum(sizes)[:-1])
        out = np.zeros((sum(sizes), len(x)))
        for i, rows in enumerate(np.split(out, np.cumsum(sizes)[:-1])):
            squeeze, width, factor = self.squeezes[i], widths[i], factors[i]
            points = [(own, width, factor) for own in moved]
            points.append((values, width + WIDTH_STEP_SHARE * self.depths[i], factor))
            points.append((values, width, factor * math.exp(STEP)))
            changes = self._of_squeeze(squeeze.delayed(lag_s), points) - here[i]
            rows[:, :p] = changes[:p].T / STEP
            rows[:, p + i] = changes[p] / WIDTH_STEP_SHARE
            rows[:, p + n : p + 2 * n - 1] = np.outer(changes[p + 1] / STEP, self.contrasts[i])
            if self.has_lag:
                earlier, later = (
                    self._of_squeeze(squeeze.delayed(lag_s + step_s), [(values, width, factor)])[0]
                    for step_s in (-LAG_STEP * LAG_UNIT_S, LAG_STEP * LAG_UNIT_S)
                )
                rows[:, -1] = (later - earlier) / (2.0 * LAG_STEP)
        return out

    def solved(self, starts: Sequence[Floats], max_evaluations: int = MAX_EVALUATIONS) -> Fitted:
        """Return the best fit from these vectors."""
        from scipy.optimize import least_squares

        low, high = self.bounds()
        solutions: list[Any] = [
            least_squares(
                self.residuals,
                np.clip(start, low + 1e-9, high - 1e-9),
                self.jacobian,
                bounds=(low, high),
                x_scale="jac",
                max_nfev=max_evaluations,
                ftol=TOLERANCE,
                xtol=TOLERANCE,
            )
            for start in starts
        ]
        best = min(solutions, key=lambda solution: float(solution.cost))
        values, widths, factors, lag_s = self.point(best.x)
        return Fitted(
            model=self.model,
            candidate=self.candidate,
            squeezes=self.squeezes,
            values=tuple(values.tolist()),
            widths_m=tuple(widths.tolist()),
            factors=tuple(factors.tolist()),
            residuals=best.fun,
            lag_s=lag_s,
            has_lag=self.has_lag,
        )


def linear_covariance(fitted: Fitted, least_error: float) -> Floats:
    """Return the covariance that the residuals leave of the logarithms of the values, and of the lag (s) if it was
    fitted, by the linearised fit.

    It is that of the values with a common stiffness which is the mean of the squeezes. `least_error`: by how much the
    forces of the model are wrong at least, over the peak. A direction that changes no force has a large variance.
    """
    problem = _Problem(fitted.model, fitted.candidate, fitted.squeezes, has_lag=fitted.has_lag)
    jacobian = problem.jacobian(problem.vector(fitted))
    scale = np.maximum(np.linalg.norm(jacobian, axis=0), 1e-12)
    _, singular, rows = np.linalg.svd(jacobian / scale, full_matrices=False)
    # The fit follows a part of the residuals' own errors, with as many directions as it has parameters.
    size, directions = jacobian.shape
    error = math.hypot(fitted.rms * math.sqrt(size / max(size - directions, 1)), least_error)
    if fitted.has_lag:
        scale[-1] /= LAG_UNIT_S
    root = (rows.T / np.maximum(singular, SMALLEST_SINGULAR) * error) / scale[:, np.newaxis]
    kept = [*range(problem.p), *[-1] * fitted.has_lag]
    covariance: Floats = (root @ root.T)[np.ix_(kept, kept)]
    return covariance


def relative(errors: Floats, peak_n: float) -> Floats:
    """Return errors of forces over the peak, all of them finite."""
    relative = errors / peak_n
    return np.clip(np.where(np.isfinite(relative), relative, NO_FORCE), -LARGEST_RESIDUAL, LARGEST_RESIDUAL)
