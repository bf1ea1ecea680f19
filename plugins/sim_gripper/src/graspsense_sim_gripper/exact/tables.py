"""The matrices of all modes of a scene, computed once, in the layout in which a tick reads them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any, Final, NamedTuple

import numpy as np

from graspsense_sim_gripper.exact.bounds import FAST, output_bounds
from graspsense_sim_gripper.exact.expm import MAX_BISECTIONS, Array, exponentials
from graspsense_sim_gripper.exact.modes import Layout, LinearScene, Shape, mode_matrices

RELAXING_DEPTH: Final = 3
"""Bisections of a tick for an event search where a state relaxes within the tick."""
GROUP: Final = 4
"""Rows of a matrix that are summed together: four multiplications side by side are one vector instruction."""

Table = Any
"""Numbers in a flat array (compiled code) or in a list (the interpreter, which indexes a list faster)."""


class Tables(NamedTuple):
    """The matrices of the modes, mode after mode. A matrix is stored by columns, with `padded` rows of zeros."""

    bisection_depth: int
    """The tick over two to this power is short against the fastest motion: events are searched with such pieces."""
    maps: Table
    """The exact map of x to x and the outputs after tick / 2^k, for k = 0 ... MAX_BISECTIONS."""
    outputs: Table
    """The map of x to the outputs at the same time."""
    direct_bound: Table
    """See `bounds.OutputBounds`, as the next two."""
    modal_projection: Table
    modal_bound: Table
    reset_map: Table
    """The rows of δ and p as the mode is entered; these are stored by rows."""
    guard_tol: Table
    """By how much the guards may be below 0."""


@lru_cache(maxsize=32)
def tables_of(scene: LinearScene, dt_s: float) -> tuple[Shape, Tables] | None:
    """Return the tables of a scene for ticks of this length, as arrays.

    None where the equations of force leave the motion of a mode undetermined.
    """
    layout = Layout(scene)
    modes = []
    for mode in layout.modes():
        matrices = mode_matrices(layout, mode)
        if matrices is None:
            return None
        modes.append(matrices)
    rates = np.array([mode.rates for mode in modes])
    n = layout.n_states
    maps, integrals = exponentials(rates, dt_s)
    outputs = np.array([[mode.force, mode.force @ mode.rates, *mode.guards] for mode in modes])
    bounds = output_bounds(rates[:, :n, :n], maps, integrals, outputs, dt_s)
    # The outputs after the step are rows of the map too, so that they do not wait for the state.
    ahead = np.concatenate([maps[:, :, :n], outputs[:, None] @ maps], axis=2)
    by_columns = (_by_columns(matrices) for matrices in (ahead, outputs, *bounds))
    reset, tol = np.array([mode.reset for mode in modes]), np.array([mode.guard_tol for mode in modes])
    flat = (np.ascontiguousarray(table).ravel() for table in (*by_columns, reset, tol))
    return layout.shape, Tables(_bisection_depth(rates[:, :n, :n], dt_s), *flat)


@lru_cache(maxsize=32)
def listed_tables_of(scene: LinearScene, dt_s: float) -> tuple[Shape, Tables] | None:
    """Return `tables_of` as lists."""
    found = tables_of(scene, dt_s)
    if found is None:
        return None
    shape, (depth, *tables) = found
    return shape, Tables(depth, *(table.tolist() for table in tables))


def padded(n_rows: int) -> int:
    """Return the number of rows that a matrix of `n_rows` rows has in a table."""
    return -(-n_rows // GROUP) * GROUP


def _by_columns(matrices: Array) -> Array:
    rows = matrices.shape[-2]
    table = np.zeros((*matrices.shape[:-2], matrices.shape[-1], padded(rows)))
    table[..., :rows] = np.swapaxes(matrices, -1, -2)
    return table


def _bisection_depth(rates: Array, dt_s: float) -> int:
    eigenvalues = np.linalg.eigvals(rates)
    fastest = float(np.abs(eigenvalues.imag).max())
    depth = max(0, math.ceil(math.log2(max(fastest * dt_s / FAST, 1e-300))))
    if float(np.abs(eigenvalues.real).max()) * dt_s > FAST:
        depth = max(depth, RELAXING_DEPTH)
    return min(depth, MAX_BISECTIONS)
