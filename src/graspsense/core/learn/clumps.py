"""Trials of a label in clumps, as windows of one recording, grasps of one object and noisy copies are, in any order.

What tells them is distance. Of trials drawn independently, the gap between the logarithms of the distances of the
neighbours m + 1 and m has the mean 1 / (m dimension) at every m (E. Levina and P. J. Bickel, NIPS 17 (2005) 777).
Behind the last trial of a clump the gap is larger, and so is the distance at which Ward's method merges a clump with
others. Both are compared with those of trials that have the same values of each feature, and the same correlations of
their ranks, but are drawn independently (a normal copula; R. B. Nelsen, An Introduction to Copulas, 2006).

Each label is then held out in parts of trials close to each other, as in block cross-validation (D. R. Roberts et al.,
Ecography 40 (2017) 913).
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
_LARGEST: Final = 25
"""Trials of a clump up to which it may be a recording; larger ones are kinds of their label."""
_DRAWS: Final = 24
_CLUMPED: Final = 6.5
"""Standard deviations by which gaps and merges, together, are larger than those of independent trials, if in clumps."""


def parts_of_clumps(values: Values, labels: Sequence[str], first_of: Numbers) -> Numbers | None:
    """Return the part of its label that each trial is in, shape (n,); None if trials are not in clumps.

    `values` are the scaled features, shape (n, features). `first_of` has the trial that each one is a copy of, itself
    if of none: copies do not count.
    """
    from scipy.cluster.hierarchy import fcluster, ward

    codes = np.unique(np.array(labels), return_inverse=True)[1]
    originals = first_of == np.arange(len(codes))
    rows_of = [np.flatnonzero(originals & (codes == code)) for code in range(codes.max() + 1)]
    judged = [rows for rows in rows_of if len(rows) >= _FEWEST]
    if values.shape[1] < 2 or not judged:
        return None
    rng = np.random.default_rng(0)
    signs = np.array([_signs(values[rows]) for rows in judged]).sum(axis=0)
    by_chance = np.sum([[*map(_signs, _draws(values[rows], rng))] for rows in judged], axis=0)
    spread = np.maximum(by_chance.std(axis=0), NEAREST)
    if ((signs - by_chance.mean(axis=0)) / spread).sum() <= _CLUMPED:
        return None
    part_of = np.arange(len(codes))
    for rows in judged:
        # Each trial is a share of its clump, which ends at its largest gap.
        clumps = (1.0 / (_gaps(values[rows]).argmax(axis=1) + 2.0)).sum()
        part_of[rows] = rows[0] + len(codes) * fcluster(ward(values[rows]), max(round(clumps), 2), "maxclust")
    return part_of[first_of]


def _signs(values: Values) -> tuple[float, float]:
    """Return the sums, over the trials of a label, of the largest gap and of the merge of the most separate clump."""
    return float(_gaps(values).max(axis=1).sum()), _separation(values)


def _gaps(values: Values) -> Values:
    """Return m times the gap behind each neighbour m of each trial, shape (trials, neighbours)."""
    from scipy.spatial.distance import cdist

    apart = cdist(values, values)
    np.fill_diagonal(apart, np.inf)
    others = max(min(len(values) // 2 - 1, _MOST_OTHERS), 2)
    near = np.sort(np.partition(apart, others, axis=1)[:, : others + 1], axis=1)
    gaps: Values = np.arange(1.0, others + 1.0) * np.diff(np.log(np.maximum(near, NEAREST)), axis=1)
    return gaps


def _separation(values: Values) -> float:
    """Return the sum over the trials of the logarithm by which the most separate clump with it is farther than wide."""
    from scipy.cluster.hierarchy import ward

    merges, n = ward(values), len(values)
    parent = np.zeros(2 * n - 1, dtype=np.int64)
    parent[merges[:, :2].astype(np.int64)] = np.arange(n, 2 * n - 1)[:, np.newaxis]
    height = np.log(np.maximum(merges[:, 2], NEAREST))
    small = np.flatnonzero(merges[:-1, 3] <= max(min(n // 2, _LARGEST), 3))
    most = np.zeros(2 * n - 1)
    most[n + small] = height[parent[n + small] - n] - height[small]
    for cluster in range(2 * n - 3, -1, -1):
        most[cluster] = max(most[cluster], most[parent[cluster]])
    return float(most[:n].sum())


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
