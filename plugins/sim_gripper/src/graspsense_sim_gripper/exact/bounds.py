"""Bounds on the change of the outputs of a mode within a tick, which exclude events without a search.

The bounds are sampled and multiplied by a safety factor; they are not proven.
"""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.exact.expm import Array

FAST: Final = 0.5
"""An eigenmode is fast if the magnitude of its eigenvalue (1/s) times the tick is above this."""
SAMPLES_LOG2: Final = 6
"""The tick is sampled at 2^6 equidistant times."""
SAFETY: Final = 2.0
"""Safety factor on the bounds, for the times between the samples."""


class OutputBounds(NamedTuple):
    """Matrices of each mode that bound the outputs y(t) for 0 <= t <= dt, given the change c = x(dt) - x(0).

        |y(t) - y(0)| <= direct |c|,        |y(t) - y(0)| <= modal |projection c|

    The first bound needs fewer operations; the second is tighter. Entries are inf if there is no bound.
    """

    direct: Array
    """Shape (n_modes, n_outputs, n_states)."""
    projection: Array
    """Shape (n_modes, 2 n_states, n_states): the slow part of c, and below it the fast modal coordinates of c."""
    modal: Array
    """Shape (n_modes, n_outputs, 2 n_states)."""


def output_bounds(rates: Array, maps: Array, integrals: Array, outputs: Array, dt_s: float) -> OutputBounds:
    """Return the bounds of each mode for a tick of `dt_s` seconds.

    `rates` are the matrices A of the states (1/s), shape (n_modes, n_states, n_states). `outputs` are the matrices C of
    the outputs y = C x, shape (n_modes, n_outputs, n_columns). `maps` and `integrals` are those of `exponentials`.

    With P(t) the integral of exp(A s) over 0 to t, and r = x'(0), the state changes by P(t) r until t, and c = P(dt) r.
    The change of y until t is therefore C P(t) P(dt)^-1 c, which is sampled.

    The projection separates fast eigenmodes from slow ones. A slow motion of many states together then counts with its
    effect on y, and not with the sum of the effects of each state.
    """
    n = rates.shape[-1]
    step, samples = maps[:, SAMPLES_LOG2, :n, :n], integrals[:, SAMPLES_LOG2, :n, :n][:, None]
    power = step
    for _ in range(SAMPLES_LOG2):
        samples = np.concatenate([samples, samples[:, -1:] + power[:, None] @ samples], axis=1)
        power = power @ power
    projection = np.zeros((len(rates), 2 * n, n))
    direct = np.full((*outputs.shape[:2], n), math.inf)
    modal = np.full((*outputs.shape[:2], 2 * n), math.inf)
    for mode, integral in enumerate(integrals[:, 0, :n, :n]):
        slow, fast, vectors = _split_by_speed(rates[mode], dt_s)
        projection[mode, :n], projection[mode, n : n + len(fast)] = slow, fast
        try:
            shares = samples[mode] @ np.linalg.inv(integral)
        except np.linalg.LinAlgError:
            continue
        changes = np.einsum("gi,tij->tgj", outputs[mode][:, :n], shares)
        for bound, basis in ((direct, np.eye(n)), (modal, np.concatenate([slow, vectors], axis=1))):
            largest = SAFETY * np.abs(changes @ basis).max(axis=0)
            bound[mode] = 0.0
            bound[mode, :, : largest.shape[1]] = np.where(np.isfinite(largest), largest, math.inf)
    return OutputBounds(direct, projection, modal)


def _split_by_speed(rates: Array, dt_s: float) -> tuple[Array, Array, Array]:
    """Return the projector onto the slow subspace, the rows that give the fast modal coordinates, and the fast vectors.

    The rows follow from the left eigenvectors of the fast eigenvalues, the vectors are the right ones. A complex pair
    is replaced by its real and imaginary parts. If the eigenvectors do not form a basis, everything counts as slow.
    """
    n = len(rates)
    sides = []
    for matrix in (rates, rates.T):
        values, vectors = np.linalg.eig(matrix)
        sides.append(
            [
                vector.real if value.imag >= 0.0 else vector.imag
                for value, vector in zip(values, vectors.T, strict=True)
                if abs(value) * dt_s > FAST
            ]
        )
    right, left = (np.array(side).reshape(-1, n) for side in sides)
    try:
        fast = np.linalg.solve(left @ right.T, left)
    except np.linalg.LinAlgError:
        fast = np.full((0, n), math.nan)
    slow = np.eye(n) - right.T[:, : len(fast)] @ fast
    if len(right) != len(left) or not np.isfinite(slow).all():
        return np.eye(n), np.zeros((0, n)), np.zeros((n, 0))
    return slow, fast, right.T[:, : len(fast)]
