"""Sampling an instance of an object, and distributing its contact force over the cells of a pad."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from graspsense_sim_gripper.scene.random_numbers import OBJECT, draw_normals, key_of
from graspsense_sim_gripper.scene.spec import (
    PATCHES,
    InstanceSpread,
    NominalParams,
    ObjectSpec,
    TermParams,
)

PAD_CELLS: Final = 15
"""Cells of the gripping face: five rows of three, the row at the tip first."""
ROW_MM: Final = 6.0
COLUMN_MM: Final = 5.6
"""Distances between the centres of neighbouring cells, along and across the pad."""


N_COMMON_DRAWS: Final = 5
"""Normal numbers that every instance takes: of its stiffness, width, offset, share and position on the pad."""
LINE, FACE = PATCHES.index("line"), PATCHES.index("face")


class Placement(NamedTuple):
    """What the draws give besides the parameters of the terms."""

    width_m: float
    """Without dents."""
    offset_m: float
    share: float
    """As in `ObjectSpec`."""
    patch_row: float
    """Position of the contact on the pad, in rows from its middle."""


def params_of_terms(spec: ObjectSpec, params: Sequence[float]) -> tuple[TermParams, ...]:
    """Return the parameters of each term of an instance with these parameters of all its terms."""
    return tuple([tuple.__new__(kind, params[begin:end]) for kind, begin, end in spec.params_of_terms])


def take_number(draws: Any, of_number: Any) -> None:
    """Replace the draws that decide which individual object it is by those of a number.

    These are its stiffness, its width and the parameters with a spread of their own, the same in every trial.
    """
    draws[0], draws[1] = of_number[0], of_number[1]
    for i in range(2, len(of_number)):
        draws[N_COMMON_DRAWS - 2 + i] = of_number[i]


def draw_params(nominal: NominalParams, stiffness_spread: float, draws: Any, params: Any) -> None:
    """Write the parameters of all terms of an instance to `params`.

    The stiffness is lognormal, and never negative. Each parameter with a spread of its own takes one of the draws from
    N_COMMON_DRAWS on, which are last so that they change no other.
    """
    stiffness_factor = math.exp(stiffness_spread * draws[0])
    own = N_COMMON_DRAWS
    for i in range(len(nominal.value)):
        value = nominal.value[i]
        if nominal.is_stiffness[i] == 1:
            value = value * stiffness_factor
        if nominal.spread[i] > 0.0:
            value = value * math.exp(nominal.spread[i] * draws[own])
            own += 1
        params[i] = value


def placed(spread: InstanceSpread, draws: Any) -> Placement:
    """Return the width of an instance without dents, and how it is placed; clipped at two standard deviations."""
    return Placement(
        spread.width_m + spread.width_spread_m * _clipped(draws[1]),
        spread.offset_m + spread.offset_spread_m * _clipped(draws[2]),
        min(spread.share + spread.share_spread * _clipped(draws[3]), 1.0),
        0.7 * _clipped(draws[4]),
    )


def _clipped(draw: float) -> float:
    return min(max(draw, -2.0), 2.0)


def deepest_dent(spec: ObjectSpec, params: Sequence[float]) -> float:
    """Return by how much (m) earlier use has made an instance with these parameters thinner."""
    dents = []
    for i, dent in spec.dents:
        kind, begin, end = spec.params_of_terms[i]
        dents.append(dent(tuple.__new__(kind, params[begin:end])))
    return max(dents, default=0.0)


def draws_of_number(spec: ObjectSpec, number: int) -> tuple[float, ...]:
    """Return the draws of the object with this number: of its stiffness, its width, and its parameters' own spreads."""
    return _draws_of_number(spec.name.partition(":")[0], number, 2 + spec.n_own_spreads)


@lru_cache(maxsize=1024)
def _draws_of_number(name: str, number: int, count: int) -> tuple[float, ...]:
    """Return the draws of the object with this number, of the class with this name."""
    digest = hashlib.blake2b(f"{name}#{number}".encode(), digest_size=8).digest()
    draws = [0.0] * count
    draw_normals(key_of(int.from_bytes(digest)), OBJECT, 0, count, draws)
    return tuple(draws)


def cell_weights(patch: int, row: float, weights: Any) -> None:
    """Write the share of each of the fifteen cells in the force on the gripping face, tip row first; their sum is 1.

    `patch` is the place in `PATCHES`, and `row` its position in rows from the middle. A line lies across the pad, as of
    an upright bottle, and its pressure falls off over about one row. A face loads all cells equally. A point loads the
    cells around it.
    """
    total = 0.0
    for i in range(PAD_CELLS):
        along, across = i // 3 - 2 - row, i % 3 - 1
        if patch == LINE:
            weights[i] = math.exp(-along * along)
        elif patch == FACE:
            weights[i] = 1.0
        else:
            weights[i] = math.exp(-(along * along + across * across) / 0.5)
        total += weights[i]
    for i in range(PAD_CELLS):
        weights[i] /= total


@cache
def present_cells(count: int) -> NDArray[np.float64]:
    """Return 1 for each of the `count` cells of the gripping face that are nearest to its middle, otherwise 0."""
    nearest = sorted(
        range(PAD_CELLS), key=lambda i: math.hypot(ROW_MM * (i // 3 - 2), COLUMN_MM * (i % 3 - 1))
    )
    present = np.zeros(PAD_CELLS)
    present[nearest[:count]] = 1.0
    return present
