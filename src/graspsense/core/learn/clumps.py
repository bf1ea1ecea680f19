"""Trials of a label in clumps, as windows of one recording, grasps of one object and noisy copies are, in any order.

What tells them is distance. Of trials drawn independently, the gap between the logarithms of the distances of the
neighbours m + 1 and m has the mean 1 / (m dimension) at every m (E. Levina and P. J. Bickel, NIPS 17 (2005) 777).
Behind the last trial of a clump the gap is larger. The largest gaps, as multiples of the mean gap between far
neighbours, are compared with those of trials that have the same values of each feature, and the same correlations of
their ranks, but are drawn independently (a normal copula; R. B. Nelsen, An Introduction to Copulas, 2006). Independent
features that follow each other along a curve have a lower dimension than these, near and far alike.

Each label is then held out in parts of trials close to each other, by Ward's method, as in block cross-validation (D.
R. Roberts et al., Ecography 40 (2017) 913).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from numpy.typing import NDArray

    Numbers = NDArray[np.int64]
    Values = NDArray[np.float64]

NEAREST: Final = 1e-7
"""Distances, in standard deviations, that are none: trials so close are equal but for rounding."""
_FEWEST: Final = 6
"""Trials of a label from which on it can be told whether they are in clumps."""
_MOST_OTHERS: Final = 14
"""Largest number of other trials in a clump behind which a gap is looked for: farther off, rings have gaps."""
_FEWEST_VALUES: Final = 10
"""Different values of a feature from which on it is measured: trials share a count or a code by chance."""
_DRAWS: Final = 48
_CLUMPED: Final = 3.5
"""Standard deviations by which the largest gaps are larger than those of independent trials, if in clumps."""


def parts_of_clumps(values: Values, labels: Sequence[str], first_of: Numbers) -> Numbers | None:
    """Return the part of its label that each trial is in, shape (n,); None if trials are not in clumps.

    `values` are the scaled features, shape (n, features), NaN for a trial without any. `first_of` has the trial that
    each one is a copy of, itself if of none: copies do not count.
    """
    from scipy.cluster.hierarchy import fcluster, ward

    codes = np.unique(np.array(labels), return_inverse=True)[1]
    originals = (first_of == np.arange(len(codes))) & ~np.isnan(values).any(axis=1)
    rows_of = [np.flatnonzero(originals & (codes == code)) for code in range(codes.max() + 1)]
    judged = [rows for rows in rows_of if len(rows) >= _FEWEST]
    values = values[:, [len(np.unique(column)) >= _FEWEST_VALUES for column in values.T]]
    if values.shape[1] < 2 or not judged:
        return None
    rng = np.random.default_rng(0)
    gaps = [_gaps(values[rows]) for rows in judged]
    draws = zip(*(_draws(values[rows], rng) for rows in judged), strict=True)
    by_chance = np.array([_largest([_gaps(drawn) for drawn in draw]) for draw in draws])
    if _largest(gaps) - by_chance.mean() <= _CLUMPED * by_chance.std():
        return None
    part_of = np.arange(len(codes))
    for rows, (gap, _) in zip(judged, gaps, strict=True):
        # Each trial is a share of its clump, which ends at its largest gap.
        clumps = (1.0 / (gap.argmax(axis=1) + 2.0)).sum()
        part_of[rows] = rows[0] + len(codes) * fcluster(ward(values[rows]), max(round(clumps), 2), "maxclust")
    return part_of[first_of]


def _largest(gaps: Sequence[tuple[Values, float]]) -> float:
    """Return the mean of the largest gaps of trials, as a multiple of the mean gap between far neighbours."""
    far = sum(len(gap) * far for gap, far in gaps)
    return float(sum(gap.max(axis=1).sum() for gap, _ in gaps) / max(far, NEAREST))


def _gaps(values: Values) -> tuple[Values, float]:
    """Return m times the gap behind each neighbour m, shape (trials, neighbours), and its mean between far ones."""
    from scipy.spatial.distance import cdist

    apart = cdist(values, values)
    np.fill_diagonal(apart, np.inf)
    half, others = len(values) // 2, max(min(len(values) // 2 - 1, _MOST_OTHERS), 2)
    apart.partition((others, half // 2, half), axis=1)
    logarithms = np.log(np.maximum(apart[:, : half + 1], NEAREST))
    far = (logarithms[:, half] - logarithms[:, half // 2]).mean() / np.log((half + 1) / (half // 2 + 1))
    near = np.sort(logarithms[:, : others + 1], axis=1)
    gaps: Values = np.arange(1.0, others + 1.0) * np.diff(near, axis=1)
    return gaps, float(far)


def _draws(values: Values, rng: np.random.Generator) -> Iterator[Values]:
    """Yield independent trials with the same values of each feature and about the same correlations of their ranks."""
    from scipy.special import ndtri

    scores = ndtri((mean_ranks(values) - 0.5) / len(values))
    _, sizes, axes = np.linalg.svd(scores, full_matrices=False)
    spread, ranked = sizes[:, np.newaxis] * axes, np.sort(values, axis=0)
    for _ in range(_DRAWS):
        normal = rng.normal(size=(len(values), len(sizes))) @ spread
        yield np.take_along_axis(ranked, np.argsort(np.argsort(normal, axis=0), axis=0), axis=0)


def mean_ranks(values: Values) -> Values:
    """Return the ranks in each column, from 1 on: equal values have their mean rank, and missing ones none."""
    ranks = np.empty(values.shape)
    for column, ranked in zip(values.T, ranks.T, strict=True):
        _, places, counts = np.unique(column, return_inverse=True, return_counts=True)
        ranked[:] = (np.cumsum(counts) - (counts - 1) / 2.0)[places]
    return np.where(np.isnan(values), np.nan, ranks)
