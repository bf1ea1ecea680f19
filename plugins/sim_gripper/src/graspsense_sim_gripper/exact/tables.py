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
"""Least bisection depth if a state relaxes within the tick."""
GROUP: Final = 4
"""Number of rows that are multiplied together: four multiplications make one vector instruction."""

Table = Any
"""Numbers in a flat array (compiled code) or in a list (the interpreter, which indexes a list faster)."""


class Tables(NamedTuple):
    """The matrices of all modes, mode after mode, each table flat.

    A matrix is stored by columns, and each column is filled with zeros to `padded` rows.
    """

    bisection_depth: int
    """Events are searched in pieces of tick / 2^depth, which are short against the fastest oscillation."""
    maps: Table
    """The exact maps from x to x and to the outputs after tick / 2^k, for k = 0 ... MAX_BISECTIONS."""
    outputs: Table
    """The map from x to the outputs at the same time."""
    direct_bound: Table
    """This and the next two: see `bounds.OutputBounds`."""
    modal_projection: Table
    modal_bound: Table
    reset_map: Table
    """The rows of δ and p when the mode is entered, see `modes.ModeMatrices.reset`; stored by rows."""
    guard_tol: Table
    """By how much each guard of each mode may be below 0."""


@lru_cache(maxsize=32)
def tables_of(scene: LinearScene, dt_s: float) -> tuple[Shape, Tables] | None:
    """Return the shape and the tables of a scene for ticks of `dt_s` seconds, as arrays.

    None if the balance of forces leaves the motion undetermined in a mode.
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
    # The outputs after the step are rows of the map as well, so that they need not wait for the new state.
    ahead = np.concatenate([maps[:, :, :n], outputs[:, None] @ maps], axis=2)
    by_columns = (_by_columns(matrices) for matrices in (ahead, outputs, *bounds))
    reset, tol = np.array([mode.reset for mode in modes]), np.array([mode.guard_tol for mode in modes])
    flat = (np.ascontiguousarray(table).ravel() for table in (*by_columns, reset, tol))
    return layout.shape, Tables(_bisection_depth(rates[:, :n, :n], dt_s), *flat)


@lru_cache(maxsize=32)
def listed_tables_of(scene: LinearScene, dt_s: float) -> tuple[Shape, Tables] | None:
    """Return what `tables_of` returns, with lists instead of arrays."""
    found = tables_of(scene, dt_s)
    if found is None:
        return None
    shape, (depth, *tables) = found
    return shape, Tables(depth, *(table.tolist() for table in tables))


def padded(n_rows: int) -> int:
    """Return the number of rows of a matrix in a table: `n_rows` rounded up to a multiple of GROUP."""
    return -(-n_rows // GROUP) * GROUP


def _by_columns(matrices: Array) -> Array:
    """Return the matrices transposed, with their columns filled to `padded` numbers."""
    rows = matrices.shape[-2]
    table = np.zeros((*matrices.shape[:-2], matrices.shape[-1], padded(rows)))
    table[..., :rows] = np.swapaxes(matrices, -1, -2)
    return table


def _bisection_depth(rates: Array, dt_s: float) -> int:
    """Return the depth at which pieces of the tick are short against every oscillation, see `FAST`."""
    eigenvalues = np.linalg.eigvals(rates)
    fastest = float(np.abs(eigenvalues.imag).max())
    depth = max(0, math.ceil(math.log2(max(fastest * dt_s / FAST, 1e-300))))
    if float(np.abs(eigenvalues.real).max()) * dt_s > FAST:
        depth = max(depth, RELAXING_DEPTH)
    return min(depth, MAX_BISECTIONS)
