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
from graspsense_identify.laws import SNAP, CandidateLaw, FitStart
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
    """The compression of an object over the largest one, and the force over its peak, at the samples."""

    compression: Floats
    force: Floats


class _Corners(NamedTuple):
    """Pairs of corners over the largest compression, and what follows from them: an entry or a row for each pair."""

    critical: Floats
    fall: Floats
    cost: Floats
    """The sum of the squared residuals; infinite if the numbers are not those of a snap-through."""
    numbers: Floats
    """The force at the contact, k1, the drop, and k2, shape (n, 4)."""


def with_corners(model: ForwardModel, law: CandidateLaw, squeezes: Sequence[Squeeze]) -> CandidateLaw:
    """Return the law with further starts at the corners that the squeezes show, if it is a snap-through alone."""
    if law.slots != (SNAP,):
        return law
    loads_m = [_loading(model, squeeze) for squeeze in squeezes]
    # Through the fingertips, a hard object has no compression but that of the noise.
    loads_m = [load for load in loads_m if len(load.force) >= LEAST_SAMPLES and load.compression[-1] > 0.0]
    if not loads_m:
        return law
    depth = float(np.median([load.compression[-1] for load in loads_m]))
    loads = [load._replace(compression=load.compression / depth) for load in loads_m]
    peak_n = float(np.median([squeeze.peak_n for squeeze in squeezes]))
    starts = [_start(*corners, depth, peak_n) for corners in zip(*_minima(loads), strict=True)]
    # The error of the width by the force at the contact is itself in error by noise.
    return evolve(law, more_starts=(*starts, *(start._replace(wider_m=0.0) for start in starts)))


def _loading(model: ForwardModel, squeeze: Squeeze) -> _Load:
    """Return the compression of the object (m) and the force over its peak, from the contact to the deepest sample."""
    compression = squeeze.width_m - squeeze.gap_m[squeeze.sample] - model.compressed_m(squeeze.force_n)
    force = squeeze.force_n / squeeze.peak_n
    begin, deepest = int(np.argmax(force > CONTACT_SHARE)), int(np.argmax(compression))
    part = slice(begin, deepest + 1)
    return _Load(compression[part], force[part])


def _minima(loads: Sequence[_Load]) -> _Corners:
    """Return the pairs of corners of the best minima on the grid, the best one first."""
    critical, fall = (axis.ravel() for axis in np.meshgrid(CRITICAL, FALL, indexing="ij"))
    tried = _at_corners(loads, critical, fall)
    cost = tried.cost.reshape(len(CRITICAL), len(FALL))
    bordered = np.pad(cost, 1, constant_values=np.inf)
    neighbours = np.lib.stride_tricks.sliding_window_view(bordered, (3, 3)).min(axis=(2, 3))
    minima = np.flatnonzero((cost <= neighbours) & np.isfinite(cost))
    best = minima[np.argsort(tried.cost[minima], kind="stable")][:BEST]
    return _Corners(*(column[best] for column in tried))


def _at_corners(loads: Sequence[_Load], critical: Floats, fall: Floats) -> _Corners:
    """Return what follows from each of these pairs of corners, over the largest compression."""
    cost, numbers = np.zeros(len(critical)), []
    begin, length = critical[:, np.newaxis], fall[:, np.newaxis]
    for compression, force in loads:
        beyond = compression - begin
        columns = np.stack(
            [
                np.ones_like(beyond),
                np.minimum(compression, begin),
                -np.clip(beyond / length, 0.0, 1.0),
                np.maximum(beyond - length, 0.0),
            ],
            axis=1,
        )
        normal = columns @ columns.transpose(0, 2, 1) + RIDGE
        solution = np.linalg.solve(normal, columns @ force[:, np.newaxis])
        residuals = (solution.transpose(0, 2, 1) @ columns)[:, 0] - force
        cost += np.sum(residuals**2, axis=1)
        numbers.append(solution[..., 0])
    median = np.median(numbers, axis=0)
    offset, k1 = median[:, 0], median[:, 1]
    snaps = (median[:, 1:].min(axis=1) > LEAST_NUMBER) & (critical * k1 + offset > 0.0)
    return _Corners(critical, fall, np.where(snaps, cost, np.inf), median)


def _start(
    critical: float, fall: float, _cost: float, numbers: Floats, depth: float, peak_n: float
) -> FitStart:
    """Return the start at a pair of corners, with the numbers that follow from them."""
    offset, k1, drop, k2 = numbers.tolist()
    # A force at the contact is that of a wider object, whose compression is larger by as much.
    wider = offset / k1
    stiffness = peak_n / depth
    units = (stiffness, depth, peak_n, depth, stiffness)
    values = np.multiply((k1, float(critical) + wider, drop, float(fall), k2), units)
    return FitStart(tuple(values.tolist()), wider * depth)


def corner_errors(fitted: Fitted) -> Floats:
    """Return the relative errors of the parameters of a snap-through that the distance between two samples causes.

    With two samples on the falling part, all three lines of the law are determined, and so are their corners. With
    fewer, the corners that were fitted and the true ones lie anywhere between two samples, and a bootstrap leaves them
    where they are.
    """
    labels = [parameter.label for parameter in fitted.candidate.free]
    if "snap.critical_m" not in labels:
        return np.zeros(len(labels))
    squeezes, values = fitted.squeezes, fitted.by_label
    ways = [np.abs(np.diff(squeeze.gap_m[squeeze.sample])) for squeeze in squeezes]
    moving = np.concatenate([way[way > MOVING_SHARE * np.max(way)] for way in ways])
    share = math.sqrt(1.0 / 6.0)
    if _on_falling_part(fitted, values["snap.critical_m"], values["snap.fall_m"]) >= LEAST_FALLING:
        share = 0.0
    error_m = share * float(np.median(moving)) / math.sqrt(len(squeezes))
    errors = {
        "snap.critical_m": error_m,
        "snap.fall_m": math.sqrt(2.0) * error_m,
        "snap.drop_n": error_m * (values["snap.k1_n_m"] + values["snap.k2_n_m"]),
    }
    return np.array([errors.get(label, 0.0) / values[label] for label in labels])


def _on_falling_part(fitted: Fitted, critical_m: float, fall_m: float) -> int:
    """Return how many samples lie on the falling part of a snap-through while the fingers close."""
    count = 0
    for squeeze, width in zip(fitted.squeezes, fitted.widths_m, strict=True):
        closure = width - squeeze.gap_m[squeeze.sample]
        compression = (closure - fitted.model.compressed_m(squeeze.force_n))[: int(np.argmax(closure)) + 1]
        count += int(np.sum((compression > critical_m) & (compression < critical_m + fall_m)))
    return count
