"""The fit of a candidate to several squeezes at once, by bounded least squares.

The parameters of the object are common to all squeezes. Each squeeze has its own width and its own factor on the
stiffness, since instances and placements differ: these are the spreads of a scene. Residuals are relative to the peak
of their squeeze, so that every squeeze has the same weight.

The Jacobian is computed by differences of the logarithms. A width or a factor acts on its own squeeze only, so one
evaluation of all squeezes gives the derivatives with respect to all widths.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense_sim_gripper.identify.forward import ForwardModel, Runs
from graspsense_sim_gripper.identify.laws import CandidateLaw
from graspsense_sim_gripper.identify.prepare import Squeeze

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]

STEP: Final = 1e-5
"""Difference of the logarithms in the Jacobian."""
WIDTH_STEP_SHARE: Final = 1e-5
"""Difference of the width in the Jacobian, as a share of the compression."""
FACTOR_WEIGHT: Final = 1e-3
"""Weight with which the logarithms of the factors are held to zero, so that the common stiffness is their mean."""
FACTOR_RANGE: Final = math.log(10.0)
WIDTH_RANGE: Final = 0.7
"""The width may differ from the first estimate by this share of the compression."""
NO_FORCE: Final = 10.0
"""Relative residual where a law gives no finite force."""
MAX_EVALUATIONS: Final = 40
TOLERANCE: Final = 1e-6
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
    jacobian: Floats
    """Of these, with respect to the logarithms of the values, the widths over the compression, and the factors'
    logarithms."""

    @property
    def rms(self) -> float:
        """The rms residual over the peak."""
        return float(np.sqrt(np.mean(self.residuals**2)))

    def at_bound(self, i: int) -> bool:
        """Whether a value is at an end of its range."""
        parameter = self.candidate.free[i]
        return not 1.02 * parameter.low < self.values[i] < parameter.high / 1.02


class _Problem:
    """The residuals and their Jacobian as functions of one vector."""

    def __init__(
        self, model: ForwardModel, candidate: CandidateLaw, squeezes: Sequence[Squeeze], masks: Sequence[Mask]
    ) -> None:
        self.model, self.candidate, self.squeezes = model, candidate, squeezes
        self.p, self.n = len(candidate.free), len(squeezes)
        self.has_factors = self.n > 1
        self.paths = model.paths(squeezes)
        self.first_widths = np.array([one.width_m for one in squeezes])
        self.depths = np.array([one.depth_m for one in squeezes])
        sizes = [int(mask.sum()) for mask in masks]
        self.size = sum(sizes)
        self.of_squeeze = np.repeat(np.arange(self.n), sizes)
        kept = list(zip(squeezes, masks, strict=True))
        self.at_node = np.concatenate([one.sample[mask] for one, mask in kept])
        self.measured = np.concatenate([one.force_n[mask] for one, mask in kept])
        self.peaks = np.repeat([one.peak_n for one in squeezes], sizes)
        self._last: tuple[Floats, Floats] | None = None
        """The last vector, and its residuals."""

    def bounds(self) -> tuple[Floats, Floats]:
        low = [math.log(one.low) for one in self.candidate.free]
        high = [math.log(one.high) for one in self.candidate.free]
        wide = [WIDTH_RANGE] * self.n
        factors = [FACTOR_RANGE] * (self.n if self.has_factors else 0)
        return (
            np.array([*low, *(-one for one in (*wide, *factors))]),
            np.array([*high, *wide, *factors]),
        )

    def split(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return the values, widths and factors of a vector, or of each row of a table."""
        p, n = self.p, self.n
        widths = self.first_widths + x[..., p : p + n] * self.depths
        factors = np.exp(x[..., p + n :]) if self.has_factors else np.ones_like(widths)
        return np.exp(x[..., :p]), widths, factors

    def of_all(self, xs: Floats) -> Floats:
        """Return the residuals of each row of a table of vectors, without those that hold the factors."""
        values, widths, factors = self.split(xs)
        numbers = self.candidate.numbers(np.repeat(values, self.n, axis=0), factors.ravel())
        path = np.tile(np.arange(self.n), len(xs))
        forces = self.model.run(self.paths, Runs(path, widths.ravel(), numbers, self.candidate.active))
        by_vector = forces.reshape(len(xs), self.n, -1)
        out: Floats = (by_vector[:, self.of_squeeze, self.at_node] - self.measured) / self.peaks
        np.nan_to_num(out, copy=False, nan=NO_FORCE, posinf=NO_FORCE, neginf=-NO_FORCE)
        return out

    def residuals(self, x: Floats) -> Floats:
        if self._last is None or not np.array_equal(self._last[0], x):
            self._last = x.copy(), self.of_all(x[np.newaxis])[0]
        held = FACTOR_WEIGHT * math.sqrt(self.size / self.n) * x[self.p + self.n :]
        return np.concatenate([self._last[1], held])

    def jacobian(self, x: Floats) -> Floats:
        here = self.residuals(x)[: self.size]
        blocks = [(self.p, WIDTH_STEP_SHARE)]
        if self.has_factors:
            blocks.append((self.p + self.n, STEP))
        moved = np.tile(x, (self.p + len(blocks), 1))
        moved[range(self.p), range(self.p)] += STEP
        for row, (first, step) in enumerate(blocks, self.p):
            moved[row, first : first + self.n] += step
        there = self.of_all(moved)
        out = np.zeros((self.size + (self.n if self.has_factors else 0), len(x)))
        out[: self.size, : self.p] = ((there[: self.p] - here) / STEP).T
        for row, (first, step) in enumerate(blocks, self.p):
            out[np.arange(self.size), first + self.of_squeeze] = (there[row] - here) / step
        if self.has_factors:
            own = np.arange(self.n)
            out[self.size + own, self.p + self.n + own] = FACTOR_WEIGHT * math.sqrt(self.size / self.n)
        return out


def whole(squeezes: Sequence[Squeeze]) -> list[Mask]:
    """Return the masks that use every sample."""
    return [np.ones(len(one.force_n), dtype=np.bool_) for one in squeezes]


def fit(
    model: ForwardModel,
    candidate: CandidateLaw,
    squeezes: Sequence[Squeeze],
    masks: Sequence[Mask] | None = None,
    start: Fitted | None = None,
) -> Fitted:
    """Return the best fit of a candidate to these squeezes, from the best of its starts, or from another fit.

    `masks`: the samples that count. `start`: a fit of the same candidate to the same squeezes.
    """
    from scipy.optimize import least_squares

    problem = _Problem(model, candidate, squeezes, whole(squeezes) if masks is None else masks)
    low, high = problem.bounds()
    best = None
    for x0 in _starts(problem, start):
        x0 = np.clip(x0, low + 1e-9, high - 1e-9)
        found = least_squares(
            problem.residuals,
            x0,
            problem.jacobian,
            bounds=(low, high),
            x_scale="jac",
            max_nfev=MAX_EVALUATIONS,
            ftol=TOLERANCE,
            xtol=TOLERANCE,
        )
        if best is None or found.cost < best.cost:
            best = found
    assert best is not None
    values, widths, factors = problem.split(best.x)
    return Fitted(
        candidate=candidate,
        values=tuple(values.tolist()),
        widths_m=tuple(widths.tolist()),
        factors=tuple(factors.tolist()),
        cost=float(best.cost),
        residuals=best.fun[: problem.size],
        jacobian=np.asarray(best.jac)[: problem.size],
    )


def held_out_rms(model: ForwardModel, fitted: Fitted, squeeze: Squeeze, width_m: float) -> float:
    """Return the rms residual over the peak of a squeeze that was not fitted, with a width and a factor of its own."""
    from scipy.optimize import least_squares

    def residuals(x: Floats) -> Floats:
        forces = model.forces(
            squeeze, fitted.candidate, fitted.values, width_m + x[0] * squeeze.depth_m, math.exp(x[1])
        )
        relative = (forces - squeeze.force_n) / squeeze.peak_n
        return np.nan_to_num(relative, nan=NO_FORCE, posinf=NO_FORCE, neginf=-NO_FORCE)

    limits = np.array([WIDTH_RANGE, FACTOR_RANGE])
    found = least_squares(
        residuals, np.zeros(2), bounds=(-limits, limits), max_nfev=15, diff_step=[STEP, STEP], ftol=TOLERANCE
    )
    return float(np.sqrt(np.mean(found.fun**2)))


def _starts(problem: _Problem, start: Fitted | None) -> list[Floats]:
    """Return the vectors to start from: that of another fit, or the best of the candidate's own."""
    n = problem.n
    factors = np.zeros(n if problem.has_factors else 0)
    if start is not None:
        shares = [
            (width - one.width_m) / one.depth_m
            for width, one in zip(start.widths_m, problem.squeezes, strict=True)
        ]
        if problem.has_factors:
            factors = np.log(start.factors)
        return [np.concatenate([np.log(start.values), shares, factors])]
    vectors = [np.concatenate([np.log(one), np.zeros(n), factors]) for one in problem.candidate.starts()]
    if len(vectors) <= STARTS:
        return vectors
    costs = np.sum(problem.of_all(np.array(vectors)) ** 2, axis=1)
    return [vectors[int(k)] for k in np.argsort(costs)[:STARTS]]
