"""The distance of a feature's distribution over grasps from its distribution in a reference, and two tests of it.

Both samples come from the same seeds, so they are pairs. Within the grasps of a label, the distance is the first
Wasserstein distance of the two samples (the area between their distribution functions), in units of the standard
deviation of the reference sample. The distance of a feature is the mean over labels. A value that is missing in only
one of two samples counts as one standard deviation for the share of grasps that it is missing in.

*Equivalence*: the upper end of a one-sided 95 % interval lies below a limit. The interval is that of a bootstrap of
pairs. A Wasserstein distance of samples is on average too large, so the test errs on the safe side.
*Difference*: pairs are exchanged at random; p is the share of exchanges with a distance at least as large.
*Power*: the share of random exchanges, which have the same distribution in both samples, that would pass the test of
equivalence with an interval of the same width.

C. Villani, Optimal Transport (Springer, 2009), chapter 6; B. Efron and R. J. Tibshirani, An Introduction to the
Bootstrap (Chapman & Hall, 1993), chapters 13 and 15.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

RESAMPLES: Final = 400
"""Bootstrap samples and exchanges; the 95 % quantile then has a standard error of one per cent."""
QUANTILE: Final = 0.95
FloatArray = NDArray[np.float64]


@frozen(kw_only=True)
class DistributionDistance:
    """The distance of a feature's distribution from that of the reference, in standard deviations of the reference."""

    feature: str
    distance: float
    upper: float
    """The upper end of the one-sided 95 % interval of the distance."""
    p_difference: float
    """The p-value of the test whether the distributions differ at all."""
    power: float
    """The probability that two equal distributions pass the test of equivalence at `limit`."""
    limit: float

    @property
    def is_equivalent(self) -> bool:
        """Whether the distance is below the limit at 95 %."""
        return self.upper <= self.limit


def distribution_distance(
    feature: str,
    sample: Sequence[float] | FloatArray,
    reference: Sequence[float] | FloatArray,
    labels: Sequence[str],
    limit: float,
    seed: int = 0,
) -> DistributionDistance:
    """Return the distance of two samples of a feature that are pairs, grasp by grasp, with its tests.

    `labels` has the label of each grasp. `limit` is in standard deviations. Raises ValueError for samples of different
    lengths.
    """
    x, y = np.asarray(sample, float), np.asarray(reference, float)
    if not len(x) == len(y) == len(labels):
        raise ValueError(
            f"{len(x)} and {len(y)} values for {len(labels)} labels: give pairs with a label each"
        )
    rng = np.random.default_rng(seed)
    names = np.asarray(labels)
    distance, drawn, exchanged = 0.0, np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for name in dict.fromkeys(labels):
        rows = np.flatnonzero(names == name)
        share = len(rows) / len(x)
        a, b = x[rows], y[rows]
        unit = _spread(a, b)
        distance += share * float(_distances(a[None], b[None], unit)[0])
        which = rng.integers(len(rows), size=(RESAMPLES, len(rows)))
        drawn += share * _distances(a[which], b[which], unit)
        swap = rng.random((RESAMPLES, len(rows))) < 0.5
        exchanged += share * _distances(np.where(swap, b, a), np.where(swap, a, b), unit)
    upper = max(float(np.quantile(drawn, QUANTILE)), distance)
    # Rounding must not decide whether an exchange that changes nothing counts as large.
    as_large = int(np.sum(exchanged >= distance * (1.0 - 1e-9)))
    return DistributionDistance(
        feature=feature,
        distance=distance,
        upper=upper,
        p_difference=(1 + as_large) / (1 + RESAMPLES),
        power=float(np.mean(exchanged + (upper - distance) <= limit)),
        limit=limit,
    )


def _spread(sample: FloatArray, reference: FloatArray) -> float:
    """Return the standard deviation of the reference; of both together if the reference does not vary, at last 1."""
    for values in (reference, np.concatenate([sample, reference])):
        known = values[~np.isnan(values)]
        if len(known) > 1 and (spread := float(np.std(known, ddof=1))) > 0.0:
            return spread
    return 1.0


def _distances(samples: FloatArray, references: FloatArray, unit: float) -> FloatArray:
    """Return the distance of each row of `samples` from the row of `references`, both (resamples, grasps)."""
    missing = np.isnan(samples), np.isnan(references)
    if not (missing[0].any() or missing[1].any()):
        gaps: FloatArray = np.abs(np.sort(samples, axis=1) - np.sort(references, axis=1)).mean(axis=1) / unit
        return gaps
    from scipy.stats import wasserstein_distance

    distances: FloatArray = np.abs(missing[0].mean(axis=1) - missing[1].mean(axis=1))
    for i, (a, b) in enumerate(zip(samples, references, strict=True)):
        known = a[~missing[0][i]], b[~missing[1][i]]
        if len(known[0]) and len(known[1]):
            distances[i] += wasserstein_distance(*known) / unit
    return distances
