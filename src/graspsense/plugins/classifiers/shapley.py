"""Contributions of features to a probability, for classifiers whose structure does not give any: Shapley values.

A feature that is not known yet has its median in training, which also stands for a missing one. The contribution of a
feature is the change of the probability when it gets its value, averaged over all orders in which the features become
known (L. S. Shapley, 1953; M. Sundararajan and A. Najmi, ICML 2020, call it *baseline Shapley*). The contributions
add up to the difference between the probability of the trial and that of the medians exactly.
"""

from __future__ import annotations

from collections.abc import Callable
from math import factorial
from typing import Final

import numpy as np
from numpy.typing import NDArray

MOST_EXACT: Final = 8
"""Largest number of features for which all sets of known features are evaluated; 2^8 probabilities."""
ORDERS: Final = 16
"""Number of random orders for more features, each of which is used forwards and backwards."""
SEED: Final = 0

Share = Callable[["NDArray[np.float64]"], "NDArray[np.float64]"]
"""Returns the probability of the label for each of some preprocessed trials, shape (trials, features)."""


def shapley_values(
    share: Share, trial: NDArray[np.float64], medians: NDArray[np.float64]
) -> tuple[float, list[float]]:
    """Return the probability of the medians, and the contribution of each feature.

    `trial` and `medians` are preprocessed, of shape (features,). The values are exact for up to `MOST_EXACT` features
    that differ from the median; for more, they are means over random orders, the same in every call.
    """
    differing = np.flatnonzero(trial != medians)
    compute = _exact if len(differing) <= MOST_EXACT else _sampled
    start, values = compute(share, trial, medians, differing)
    parts = np.zeros(len(trial))
    parts[differing] = values
    return start, parts.tolist()


def _exact(
    share: Share, trial: NDArray[np.float64], medians: NDArray[np.float64], differing: NDArray[np.int64]
) -> tuple[float, NDArray[np.float64]]:
    n = len(differing)
    sets = np.arange(2**n)
    known = (sets[:, np.newaxis] >> np.arange(n)) & 1 == 1
    shares = share(_rows(trial, medians, differing, known))
    sizes = known.sum(axis=1)
    weights = np.array([factorial(k) * factorial(n - 1 - k) / factorial(n) for k in range(n)])
    values = np.zeros(n)
    for i in range(n):
        without = sets[~known[:, i]]
        values[i] = weights[sizes[without]] @ (shares[without | (1 << i)] - shares[without])
    return float(shares[0]), values


def _sampled(
    share: Share, trial: NDArray[np.float64], medians: NDArray[np.float64], differing: NDArray[np.int64]
) -> tuple[float, NDArray[np.float64]]:
    rng, n = np.random.default_rng(SEED), len(differing)
    forwards = [rng.permutation(n) for _ in range(ORDERS)]
    orders = np.array([order for forward in forwards for order in (forward, forward[::-1])])
    rank = np.argsort(orders, axis=1)
    # After k steps of an order, the features of rank below k are known.
    known = rank[:, np.newaxis, :] < np.arange(n + 1)[:, np.newaxis]
    shares = share(_rows(trial, medians, differing, known.reshape(-1, n))).reshape(len(orders), n + 1)
    steps = np.take_along_axis(np.diff(shares, axis=1), rank, axis=1)
    return float(shares[0, 0]), np.asarray(steps.mean(axis=0))


def _rows(
    trial: NDArray[np.float64],
    medians: NDArray[np.float64],
    differing: NDArray[np.int64],
    known: NDArray[np.bool_],
) -> NDArray[np.float64]:
    """Return the trial with the medians in place of the features that are not known, a row for each set."""
    rows = np.tile(medians, (len(known), 1))
    rows[:, differing] = np.where(known, trial[differing], medians[differing])
    return rows
