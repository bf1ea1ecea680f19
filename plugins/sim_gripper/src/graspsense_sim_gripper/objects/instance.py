"""Sampling an instance of an object, and distributing its contact force over the cells of a pad."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import cache, lru_cache
from typing import Final

import numpy as np
from attrs import frozen

from graspsense_sim_gripper.objects.spec import ObjectSpec, TermParams
from graspsense_sim_gripper.random_numbers import Generator

GRAVITY_M_S2: Final = 9.80665
PAD_CELLS: Final = 15
"""Cells of the gripping face: five rows of three, the row at the tip first."""
ROW_MM: Final = 6.0
COLUMN_MM: Final = 5.6
"""Distances between the centres of neighbouring cells, along and across the pad."""


@frozen(kw_only=True)
class Instance:
    """One individual object and its placement: sampled from its spec, or with the nominal values."""

    spec: ObjectSpec
    width_m: float
    """The present width, from which a dent of earlier use is subtracted."""
    offset_m: float
    share: float
    """As in `ObjectSpec`."""
    table_n: float
    """Friction of the table, which a finger has to overcome to push the object."""
    kinds: tuple[str, ...]
    terms: tuple[TermParams, ...]
    """The parameters of its terms."""
    patch_row: float
    """Position of the contact on the pad, in rows from its middle."""


def sample(spec: ObjectSpec, rng: Generator | None, number: int | None = None) -> Instance:
    """Return an instance that `rng` draws from the spreads of the spec; without `rng`, one with the nominal values.

    With a number it is one particular object. Its stiffness, its width and the parameters with a spread of their own
    then depend on the class and the number only, and are the same in every trial; `rng` draws its placement.
    """
    n_own = spec.n_own_spreads
    # Those of parameters with a spread of their own are drawn last, so that they change no other draw.
    draws = rng.standard_normal(5 + n_own).tolist() if rng is not None else [0.0] * (5 + n_own)
    if rng is not None and number is not None:
        of_number = _draws_of_number(spec.name.partition(":")[0], number, 2 + n_own)
        draws[:2], draws[5:] = of_number[:2], of_number[2:]
    # The stiffness is lognormal, and never negative. All other values are clipped at two standard deviations.
    stiffness_factor = math.exp(spec.stiffness_spread * draws[0])
    clipped = [min(max(draw, -2.0), 2.0) for draw in draws[:5]]
    params = _sampled_params(spec, stiffness_factor, draws[5:])
    terms = tuple([tuple.__new__(kind, params[begin:end]) for kind, begin, end in spec.params_of_terms])
    dents = [dent(terms[i]) for i, dent in spec.dents]
    return Instance(
        spec=spec,
        width_m=spec.width_m + spec.width_spread_m * clipped[1] - max(dents, default=0.0),
        offset_m=spec.offset_m + spec.offset_spread_m * clipped[2],
        share=min(spec.share + spec.share_spread * clipped[3], 1.0),
        table_n=spec.friction * spec.mass_kg * GRAVITY_M_S2,
        kinds=spec.kinds,
        terms=terms,
        patch_row=0.7 * clipped[4],
    )


@lru_cache(maxsize=1024)
def _draws_of_number(name: str, number: int, count: int) -> tuple[float, ...]:
    """Return the draws of the object with this number, of the class with this name."""
    rng = np.random.default_rng([number, *name.encode()])
    return tuple(rng.standard_normal(count).tolist())


def _sampled_params(spec: ObjectSpec, stiffness_factor: float, draws: Sequence[float]) -> list[float]:
    """Return the parameters of all terms of an instance; each with a spread of its own takes one of the `draws`."""
    nominal = spec.nominal_params
    values = [value * stiffness_factor if stiff else value for value, stiff, _ in nominal]
    if draws:
        own = iter(draws)
        values = [
            value * math.exp(param.spread * next(own)) if param.spread > 0.0 else value
            for value, param in zip(values, nominal, strict=True)
        ]
    return values


def cell_weights(patch: str, row: float) -> tuple[float, ...]:
    """Return the share of each of the fifteen cells in the force on the gripping face, tip row first; their sum is 1.

    `patch` is `line`, `face` or `point`, and `row` its position in rows from the middle. A line lies across the pad, as
    of an upright bottle, and its pressure falls off over about one row. A face loads all cells equally. A point loads
    the cells around it.
    """
    if patch == "face":
        weights = [1.0] * PAD_CELLS
    elif patch == "line":
        along = [math.exp(-(r - row) * (r - row)) for r in range(-2, 3)]
        weights = [weight for weight in along for _ in range(3)]
    else:
        places = [(r - row, c) for r in range(-2, 3) for c in range(-1, 2)]
        weights = [math.exp(-(r * r + c * c) / 0.5) for r, c in places]
    total = sum(weights)
    return tuple([weight / total for weight in weights])


@cache
def central_cells(count: int) -> frozenset[int]:
    """Return the indices of the `count` cells of the gripping face that are nearest to its middle."""
    return frozenset(
        sorted(range(PAD_CELLS), key=lambda i: math.hypot(ROW_MM * (i // 3 - 2), COLUMN_MM * (i % 3 - 1)))[
            :count
        ]
    )
