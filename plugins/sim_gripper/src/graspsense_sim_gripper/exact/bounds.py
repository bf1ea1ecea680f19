"""Bounds on how far the outputs of a mode can depart inside a tick from their values at its beginning."""

from __future__ import annotations

import math
from typing import Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.exact.expm import Array

FAST: Final = 0.5
"""A motion is fast if its eigenvalue (1/s) times the tick is above this in magnitude."""
SAMPLES_LOG2: Final = 6
"""The tick is sampled at two to this power instants."""
SAFETY: Final = 2.0
"""Factor on the bounds, for the time between the samples."""


class OutputBounds(NamedTuple):
    """Bounds of each mode on |y(t) - y(0)| for 0 <= t <= dt, from the change c = x(dt) - x(0) of the state.

        |y(t) - y(0)| <= direct |c|,        |y(t) - y(0)| <= modal |projection c|

    The first needs fewer operations; the second is tighter. Entries are inf where there is no bound.
    """

    direct: Array
    """Shape (n_modes, n_outputs, n_states)."""
    projection: Array
    """Shape (n_modes, 2 n_states, n_states): the slow part of a change of the state, and its fast modal coordinates."""
    modal: Array
    """Shape (n_modes, n_outputs, 2 n_states)."""


def output_bounds(rates: Array, maps: Array, integrals: Array, outputs: Array, dt_s: float) -> OutputBounds:
    """Return the bounds of each mode.

    `rates` are the matrices A of the states, `outputs` the rows C of the outputs y = C x; `maps` and `integrals` are
    those of `exponentials`. With P(t) the integral of exp(A s) over 0 to t and r = x'(0), the state changes by P(t) r
    until t, and c = P(dt) r. The change of y until t is therefore C P(t) P(dt)^-1 c, which is sampled.

    The projection separates fast motions of the tick from slow ones. A slow motion in which many states change together
    then counts by its effect on y, and not by the sum of the effects of each state.
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
    """Return the projector onto the slow subspace, the rows that give the fast modal coordinates, and their vectors.

    The left and right eigenvectors of the fast eigenvalues give the latter two; a complex pair counts as its real and
    imaginary parts. Where they do not form a basis, every motion counts as slow.
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
