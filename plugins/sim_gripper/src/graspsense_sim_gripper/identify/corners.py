"""Where the fit of a snap-through starts: the corners of the law that explain the measured forces best.

Between its corners a snap-through is a straight line. For given corners its force is linear in the two stiffnesses, the
drop, and the product of stiffness and an error of the width. So the corners are tried on a grid, and the other numbers
follow from linear least squares (separable least squares: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). A fit that
starts between two corners of which there is no sample often ends in another minimum.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense_sim_gripper.identify.forward import ForwardModel
from graspsense_sim_gripper.identify.laws import SNAP, CandidateLaw, FitStart
from graspsense_sim_gripper.identify.prepare import CONTACT_SHARE, Squeeze

Floats = NDArray[np.float64]

CRITICAL: Final = np.linspace(0.04, 0.96, 47)
"""Critical compressions that are tried, over the largest compression."""
FALL: Final = np.geomspace(0.01, 0.8, 12)
"""Lengths of the fall that are tried, over the largest compression."""
BEST: Final = 4
"""Minima over the critical compression from which a fit starts."""
LEAST_SAMPLES: Final = 6
"""Of a squeeze during the compression; four numbers follow from them."""


def with_corners(model: ForwardModel, law: CandidateLaw, squeezes: Sequence[Squeeze]) -> CandidateLaw:
    """Return the law with further starts at the corners that the squeezes show, if it is a snap-through alone."""
    if law.slots != (SNAP,):
        return law
    loads = [
        one for one in (_loading(model, squeeze) for squeeze in squeezes) if len(one[0]) >= LEAST_SAMPLES
    ]
    if not loads:
        return law
    depth = float(np.median([compression[-1] for compression, _ in loads]))
    best: list[tuple[float, FitStart]] = []
    for critical in CRITICAL * depth:
        tried = [_at_corners(loads, float(critical), float(fall)) for fall in FALL * depth]
        best.append(min(tried, key=lambda one: one[0]))
    costs = np.array([np.inf, *(cost for cost, _ in best), np.inf])
    minima = np.flatnonzero((costs[1:-1] <= costs[:-2]) & (costs[1:-1] < costs[2:]))
    order = sorted(minima.tolist(), key=lambda k: best[k][0])[:BEST]
    peak_n = float(np.median([one.peak_n for one in squeezes]))
    units = [peak_n if one.is_force else 1.0 for one in law.free]
    starts = [best[k][1] for k in order if math.isfinite(best[k][0])]
    scaled = [FitStart(tuple(np.multiply(one.values, units).tolist()), one.wider_m) for one in starts]
    # The error of the width by the force at the contact is itself in error by noise.
    return evolve(law, more_starts=(*scaled, *(one._replace(wider_m=0.0) for one in scaled)))


def _loading(model: ForwardModel, squeeze: Squeeze) -> tuple[Floats, Floats]:
    """Return the compression of the object and the force over its peak, from the contact to the deepest sample."""
    compression = squeeze.width_m - squeeze.gap_m[squeeze.sample] - model.compressed_m(squeeze.force_n)
    force = squeeze.force_n / squeeze.peak_n
    first, deepest = int(np.argmax(force > CONTACT_SHARE)), int(np.argmax(compression))
    part = slice(first, deepest + 1)
    return compression[part], force[part]


def _at_corners(
    loads: Sequence[tuple[Floats, Floats]], critical: float, fall: float
) -> tuple[float, FitStart]:
    """Return the sum of the squared residuals, and the start for a peak of 1 N, for given corners.

    The sum is infinite if the numbers are not those of a snap-through.
    """
    cost, numbers = 0.0, []
    for compression, force in loads:
        columns = np.column_stack(
            [
                np.ones(len(compression)),
                np.minimum(compression, critical),
                -np.clip((compression - critical) / fall, 0.0, 1.0),
                np.maximum(compression - critical - fall, 0.0),
            ]
        )
        solution, *_ = np.linalg.lstsq(columns, force, rcond=None)
        cost += float(np.sum((columns @ solution - force) ** 2))
        numbers.append(solution)
    offset, k1, drop, k2 = np.median(numbers, axis=0).tolist()
    if min(k1, drop, k2) <= 0.0 or critical + offset / k1 <= 0.0:
        return math.inf, FitStart((), 0.0)
    # A force at the contact is that of a wider object, whose compression is larger by as much.
    wider = offset / k1
    return cost, FitStart((k1, critical + wider, drop, fall, k2), wider)
