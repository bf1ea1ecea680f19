"""The corners of a snap-through: where its fit starts, and the errors of its numbers between two samples.

A fit starts at the corners of the law that explain the measured forces best.

Between its corners a snap-through is a straight line. For given corners its force is linear in the two stiffnesses, the
drop, and the product of stiffness and an error of the width. So the corners are tried on a grid, and the other numbers
follow from linear least squares (separable least squares: Golub and Pereyra, SIAM J. Numer. Anal. 10, 1973). The
derivatives of a fit jump where a corner passes a sample, so the minimum that it reaches from coarse corners can depend
on rounding: the grid is fine.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from attrs import evolve
from numpy.typing import NDArray

from graspsense_identify.fit import Fitted
from graspsense_identify.forward import ForwardModel
from graspsense_identify.laws import SNAP, CandidateLaw
from graspsense_identify.prepare import CONTACT_SHARE, Squeeze

Floats = NDArray[np.float64]

CRITICAL: Final = np.linspace(0.04, 0.96, 93)
"""Critical compressions that are tried, over the largest compression."""
FALL: Final = np.geomspace(0.01, 0.8, 36)
"""Lengths of the fall that are tried, over the largest compression."""
BEST: Final = 6
"""Minima of the grid from which a fit starts."""
LEAST_SAMPLES: Final = 6
"""Of a squeeze during the compression; four numbers follow from them."""
WIDTH_WEIGHT: Final = 0.01
"""Weight of a force at the contact in the least squares. Where a single sample precedes the critical compression, it
does not determine both stiffness and width: then the width is the first estimate."""
RIDGE: Final = np.diag([WIDTH_WEIGHT**2, 1e-12, 1e-12, 1e-12])
"""Added to the normal equations: the weight of the width, and small numbers that keep the equations solvable where no
sample shows a stiffness or a drop."""
LEAST_NUMBER: Final = 1e-6
"""A stiffness or a drop, over those of the squeeze, that is smaller is shown by no sample."""
MOVING_SHARE: Final = 0.3
"""Where the gap changes by at least this share of its largest change between measurements, the fingers move."""
LEAST_FALLING: Final = 2
"""Samples on the falling part of a snap-through that determine its line."""


class _Load(NamedTuple):
    """The compression of an object and the force over its peak, at the samples until the largest compression."""

    compression: Floats
    force: Floats


def with_corners(model: ForwardModel, law: CandidateLaw, squeezes: Sequence[Squeeze]) -> CandidateLaw:
    """Return the law with further starts at the corners that the squeezes show, if it is a snap-through alone."""
    if law.slots != (SNAP,) or law.fixed:
        return law
    loads = [_loading(model, squeeze) for squeeze in squeezes]
    # Through the fingertips, a hard object has no compression but that of the noise.
    loads = [load for load in loads if len(load.force) >= LEAST_SAMPLES and load.compression[-1] > 0.0]
    if not loads:
        return law
    depth = float(np.median([load.compression[-1] for load in loads]))
    peak_n = float(np.median([squeeze.peak_n for squeeze in squeezes]))
    starts = []
    for critical, fall, (offset, k1, drop, k2) in _minima(loads, depth):
        # A force at the contact is that of a wider object, whose compression is larger by as much, or of noise.
        units = np.array([peak_n / depth, depth, peak_n, depth, peak_n / depth])
        starts.append(tuple((units * (k1, critical + offset / k1, drop, fall, k2)).tolist()))
    return evolve(law, more_starts=tuple(starts))


def _loading(model: ForwardModel, squeeze: Squeeze) -> _Load:
    """Return the compression of the object (m) and the force over its peak, from the contact to the deepest sample."""
    compression = squeeze.width_m - squeeze.gap_m[squeeze.sample] - model.compressed_m(squeeze.force_n)
    force = squeeze.force_n / squeeze.peak_n
    begin, deepest = int(np.argmax(force > CONTACT_SHARE)), int(np.argmax(compression))
    part = slice(begin, deepest + 1)
    return _Load(compression[part], force[part])


def _minima(loads: Sequence[_Load], depth: float) -> list[tuple[float, float, Floats]]:
    """Return the corners over the depth at the best minima on the grid, the best first, and what follows from each.

    These are the force at the contact, k1, the drop, and k2, over the peak and the depth.
    """
    critical, fall = (axis.ravel() for axis in np.meshgrid(CRITICAL, FALL, indexing="ij"))
    normal, right, squares = np.tile(RIDGE, (len(critical), 1, 1)), np.zeros((len(critical), 4)), 0.0
    for load in loads:
        compression = load.compression / depth
        beyond = compression - critical[:, np.newaxis]
        length = fall[:, np.newaxis]
        columns = np.stack(
            [
                np.ones_like(beyond),
                np.minimum(compression, critical[:, np.newaxis]),
                -np.clip(beyond / length, 0.0, 1.0),
                np.maximum(beyond - length, 0.0),
            ],
            axis=1,
        )
        normal += columns @ columns.transpose(0, 2, 1)
        right += columns @ load.force
        squares += float(load.force @ load.force)
    numbers = np.linalg.solve(normal, right[:, :, np.newaxis])[:, :, 0]
    snaps = (numbers[:, 1:].min(axis=1) > LEAST_NUMBER) & (critical * numbers[:, 1] + numbers[:, 0] > 0.0)
    cost = np.where(snaps, squares - np.sum(numbers * right, axis=1), np.inf)
    grid = cost.reshape(len(CRITICAL), len(FALL))
    bordered = np.pad(grid, 1, constant_values=np.inf)
    neighbours = np.lib.stride_tricks.sliding_window_view(bordered, (3, 3)).min(axis=(2, 3))
    minima = np.flatnonzero((grid <= neighbours) & np.isfinite(grid))
    best = minima[np.argsort(cost[minima], kind="stable")][:BEST]
    return [(float(critical[k]), float(fall[k]), numbers[k]) for k in best]


def corner_errors(fitted: Fitted) -> Floats:
    """Return the relative errors of the parameters of a snap-through that the distance between two samples causes.

    With two samples on the falling part, all three lines of the law are determined, and so are their corners. With
    fewer, the corners that were fitted and the true ones lie anywhere between two samples, and a bootstrap leaves them
    where they are.
    """
    labels = [parameter.label for parameter in fitted.candidate.free]
    if "snap.fall_m" not in labels:
        return np.zeros(len(labels))
    squeezes, values = fitted.squeezes, fitted.by_label
    critical_m, fall_m = values["snap.critical_m"], values["snap.fall_m"]
    ways, falling = [], 0
    for squeeze, width in zip(squeezes, fitted.widths_m, strict=True):
        gap = squeeze.gap_m[squeeze.sample]
        compression = (width - gap - fitted.model.compressed_m(squeeze.force_n))[squeeze.loading]
        falling += int(np.sum((compression > critical_m) & (compression < critical_m + fall_m)))
        way = np.abs(np.diff(gap))
        ways.append(way[way > MOVING_SHARE * np.max(way)])
    share = 0.0 if falling >= LEAST_FALLING else math.sqrt(1.0 / 6.0)
    error_m = share * float(np.median(np.concatenate(ways))) / math.sqrt(len(squeezes))
    errors = {
        "snap.critical_m": error_m,
        "snap.fall_m": math.sqrt(2.0) * error_m,
        "snap.drop_n": error_m * (values["snap.k1_n_m"] + values["snap.k2_n_m"]),
    }
    return np.array([errors.get(label, 0.0) / values[label] for label in labels])
