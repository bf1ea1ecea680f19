"""Trials of a label in clumps, as windows of one recording and grasps of one object are, whatever their order.

Two signs together tell: the nearest trials have the same label far more often than others close by, and trials are
closer to each other than to trials drawn from the spread around them. Each label is then held out in parts of trials
close to each other, as in block cross-validation (D. R. Roberts et al., Ecography 40 (2017) 913).

Noisy copies of each trial, and as many grasps of each object, are told by a gap: of trials drawn independently, the
logarithm of the distances of the neighbours m + 1 and m has the mean 1 / (m dimension) at every m (E. Levina and P. J.
Bickel, NIPS 17 (2005) 777). Behind the m others that are of the same one, it is larger than at other m.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Numbers = NDArray[np.int64]
    Values = NDArray[np.float64]

NEAREST: Final = 1e-7
"""Distances, in standard deviations, below which the difference of two squares is not known."""
_FEWEST_CLUMPED: Final = 12
"""Trials of a label from which on it can be told whether they are in clumps."""
_LARGEST_CLUMP: Final = 25
"""Trials of a clump up to which it may be a recording or an object; larger ones are kinds of their label."""
_CLUMPED: Final = (3.0, 2.0)
"""Standard deviations by which near trials have the label more often, and are closer, than others, if in clumps."""
_SECOND: Final = 1
"""Place of the nearest distance by which clumps are told, so that pairs, as copies with noise, are none."""
_LESS_FAR: Final = 0.8
"""Share of the agreement of the labels, beyond chance, that is lost outside a clump."""
PARTS: Final = 10
"""Parts of each label that are held out, if its trials are in clumps: ten folds."""
_MOST_REPEATED: Final = 9
"""Largest number of others that are of the same one as a trial: ten grasps of an object are usual."""
_FEWEST_REPEATED: Final = 6
"""Trials for each of these others from which on they can be told; each label has half as many groups of them."""
_GAP: Final = 3.0
"""Standard deviations by which the gap behind these is wider than gaps between other neighbours."""


def distances_between(values: Values, others: Values) -> Values:
    """Return the distance of each trial to each of the others."""
    squares = (values**2).sum(axis=1)[:, np.newaxis] + (others**2).sum(axis=1)
    distances: Values = np.sqrt(np.maximum(squares - 2.0 * values @ others.T, 0.0))
    return distances


def parts_of_clumps(values: Values, labels: Sequence[str], copies: Numbers) -> Numbers | None:
    """Return the part of its label that each trial is in, shape (n,); None if trials are not in clumps.

    `values` are the scaled features, shape (n, features). The pairs of trials `copies`, shape (2, pairs), do not count.
    """
    from scipy.cluster.hierarchy import fcluster, ward

    codes = np.unique(np.array(labels), return_inverse=True)[1]
    if values.shape[1] < 2:
        return None
    apart = distances_between(values, values)
    np.fill_diagonal(apart, np.inf)
    apart[copies[0], copies[1]] = apart[copies[1], copies[0]] = np.inf
    # A coarse feature puts trials on a lattice, and copies lie at equal distances from others: both make gaps.
    fine = all(2 * len(np.unique(column)) > len(values) for column in values.T)
    repeated = _repeated(apart, codes) if fine and not copies.size else 0
    if not repeated and not _in_clumps(values, codes, apart):
        return None
    part_of = np.zeros(len(codes), dtype=np.int64)
    for code, size in enumerate(np.bincount(codes).tolist()):
        rows = np.flatnonzero(codes == code)
        parts = max(size // (repeated + 1), 1) if repeated else PARTS
        part_of[rows] = fcluster(ward(values[rows]), parts, "maxclust") if size > parts else np.arange(size)
    return codes * len(codes) + part_of


def _repeated(apart: Values, codes: Numbers) -> int:
    """Return how many others are of the same one as each trial, by the gap behind them; 0 if there is none.

    Only trials of the same label are compared, and those of labels whose trials may be of several: others of another
    label that lie between hide the gap, and labels that are far from each other have one too.
    """
    of_label = np.bincount(codes)[codes]
    near = np.sort(np.where(codes[:, np.newaxis] == codes, apart, np.inf), axis=1)[:, : _MOST_REPEATED + 2]
    near = np.where(np.isinf(near), np.nan, np.clip(near, NEAREST, 1.0 / NEAREST))
    gaps = np.arange(1, near.shape[1]) * np.diff(np.log(near), axis=1)
    # Two trials that are next to each other have about the same distances, so that they count as one.
    wider = [0.0]
    for others in range(1, min(_MOST_REPEATED, len(apart) // _FEWEST_REPEATED) + 1):
        judged = gaps[of_label >= _FEWEST_REPEATED * (others + 1) // 2]
        wide = len(judged) >= _FEWEST_REPEATED * others
        beyond = judged[:, others - 1] - np.nanmean(np.delete(judged, others - 1, axis=1), axis=1)
        wider.append(
            math.sqrt(len(judged) / 2.0) * beyond.mean() / max(beyond.std(), NEAREST) if wide else 0.0
        )
    return int(np.argmax(wider)) if max(wider) > _GAP else 0


def _in_clumps(values: Values, codes: Numbers, apart: Values) -> bool:
    """Return whether near trials have the same label, and are close, more than smooth distributions make them.

    The first is M. F. Schilling's count of neighbours (J. Am. Stat. Assoc. 81 (1986) 799), of the two nearest and of
    others; the second compares distances as B. Hopkins and J. G. Skellam do (Ann. Bot. 18 (1954) 213), with points
    drawn from the normal distribution of the third of a label that is around a trial.
    """
    sizes = np.bincount(codes)
    many = sizes >= _FEWEST_CLUMPED
    if many.sum() < 2:
        return False
    fewest, judged = int(sizes[many].min()), many[codes]
    begin = min(fewest // 4, _LARGEST_CLUMP)
    same = codes[np.argsort(apart, axis=1, kind="stable")] == codes[:, np.newaxis]
    near, far = same[:, :2].mean(axis=1), same[:, begin : begin + max(fewest // 12, 1)].mean(axis=1)
    by_chance = (sizes[codes] - 1.0) / (len(codes) - 1.0)
    # Each label weighs as much as any other.
    weights = judged / sizes[codes] / many.sum()
    near_beyond, far_beyond = (float(weights @ (share - by_chance)) for share in (near, far))
    spread = math.sqrt(float(weights**2 @ (near - far - near_beyond + far_beyond) ** 2))
    if far_beyond > _LESS_FAR * near_beyond or near_beyond - far_beyond <= _CLUMPED[0] * spread:
        return False
    rng = np.random.default_rng(0)
    closer = np.concatenate(
        [
            _closer(values[codes == code], apart[np.ix_(codes == code, codes == code)], rng)
            for code in np.flatnonzero(many)
        ]
    )
    return bool(closer.mean() * math.sqrt(len(closer)) > _CLUMPED[1] * closer.std())


def _closer(values: Values, apart: Values, rng: np.random.Generator) -> Values:
    """Return the logarithm of how many times closer the second other trial is to each one than to a point around it."""
    n = len(values)
    around = np.argsort(apart, axis=1, kind="stable")[:, : n // 3 - 1]
    around = np.column_stack([np.arange(n), around])
    drawn = rng.normal(size=around.shape)
    shares = (drawn - drawn.mean(axis=1, keepdims=True)) / math.sqrt(around.shape[1] - 1.0)
    weights = np.zeros((n, n))
    np.put_along_axis(weights, around, shares + 1.0 / around.shape[1], axis=1)
    to_a_trial, to_a_point = (
        np.clip(np.partition(distances, _SECOND, axis=1)[:, _SECOND], NEAREST, 1.0 / NEAREST)
        for distances in (apart, distances_between(weights @ values, values))
    )
    closer: Values = np.log(to_a_point / to_a_trial)
    return closer
