"""The best of several candidates: comparisons with it that stay right, and a rate that the choice does not raise.

The candidate with the highest rate is often the luckiest one: among equal candidates its rate is too high, and others
seem worse. Both are corrected by how the rates of all candidates vary together when units are drawn anew (multiplier
bootstrap, V. Chernozhukov, D. Chetverikov and K. Kato, Ann. Statist. 41 (2013) 2786). A unit is an instance, or a trial
where instances are not known.

Differences: the largest studentised difference of any two candidates has a quantile, with which the intervals of all
pairs hold together; so no candidate that equals the best is called worse in 95 % of cases, whichever seems best.

Rate of the chosen one: the best among the units of a bootstrap sample is judged by the units that are not in it, and
the mean over many samples is the rate (I. Tsamardinos, E. Greasidou and G. Borboudakis, Mach. Learn. 107 (2018) 1895).
The lower end of its interval is that with which the rates of all candidates hold together.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from attrs import field, frozen
from numpy.typing import NDArray

from graspsense.evaluation.intervals import Interval, percent, percentages, rate_of

DRAWS: Final = 2000
"""Number of bootstrap samples."""
_SEED: Final = 20101


@frozen(kw_only=True)
class ChosenRate:
    """The rate of the candidate that was chosen because it has the highest one, without the luck of the choice.

    `candidates` is the number of candidates. `interval` is at 95 %, None where single rates have none either.
    """

    rate: float
    interval: Interval | None
    candidates: int = field(alias="of")

    @property
    def words(self) -> str:
        """The rate with its interval."""
        interval = "no interval" if self.interval is None else f"95 %: {percentages(self.interval)}"
        return f"{percent(self.rate)} ({interval})"


def comparisons_of(right: NDArray[np.bool_], instances: Sequence[str] | None) -> float:
    """Return how many independent comparisons those of all pairs of candidates amount to; at least 1.

    `right`, of shape (candidates, trials), says which trials each candidate recognises.
    """
    parts = _of_units(right, instances)
    moved = _moved(parts)
    largest = np.zeros(DRAWS)
    for k in range(1, len(parts)):
        differences = parts[k] - parts[:k]
        spread = np.sqrt((differences**2).sum(axis=1))
        varying = spread > 0.0
        if varying.any():
            shifts = np.abs(moved[:, [k]] - moved[:, :k])[:, varying] / spread[varying]
            largest = np.maximum(largest, shifts.max(axis=1))
    return _equivalent(float(np.quantile(largest, 0.95)))


def rate_of_chosen(
    right: NDArray[np.bool_], instances: Sequence[str] | None, no_interval: str = "", folds: int = 0
) -> ChosenRate:
    """Return the rate of the candidate with the highest one, as `comparisons_of` takes them, from so many folds."""
    totals, sizes = _units(right, instances)
    best = int(right.sum(axis=1).argmax())
    rng = np.random.default_rng(_SEED)
    held_out = []
    for _ in range(DRAWS // 2):
        drawn = np.bincount(rng.integers(len(sizes), size=len(sizes)), minlength=len(sizes))
        outside = drawn == 0
        if outside.any():
            chosen = int((totals @ drawn).argmax())
            held_out.append((totals[chosen, outside].sum(), sizes[outside].sum()))
    if not held_out:
        return ChosenRate(rate=float(right[best].mean()), interval=None, of=len(right))
    rights, trials = np.array(held_out).sum(axis=0)
    rate = min(float(rights / trials), float(right[best].mean()))
    parts = _of_units(right, instances)
    spread = np.sqrt((parts**2).sum(axis=1))
    varying = spread > 0.0
    largest = (_moved(parts)[:, varying] / spread[varying]).max(axis=1) if varying.any() else np.zeros(DRAWS)
    comparisons = _equivalent(float(np.quantile(largest, 0.975)))
    answers = right[best].tolist()
    alone = rate_of(answers, instances, no_interval, folds=folds).interval
    together = rate_of(answers, instances, no_interval, comparisons, folds=folds).interval
    interval = None if alone is None or together is None else (min(together[0], rate), max(alone[1], rate))
    return ChosenRate(rate=rate, interval=interval, of=len(right))


def _units(
    right: NDArray[np.bool_], instances: Sequence[str] | None
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the right answers of each candidate for each unit, and the number of trials of each unit."""
    if instances is None:
        return right.astype(np.float64), np.ones(right.shape[1])
    _, unit_of = np.unique(np.array(instances), return_inverse=True)
    sizes = np.bincount(unit_of).astype(np.float64)
    return np.array([np.bincount(unit_of, row, len(sizes)) for row in right.astype(np.float64)]), sizes


def _of_units(right: NDArray[np.bool_], instances: Sequence[str] | None) -> NDArray[np.float64]:
    """Return how much each unit moves the rate of each candidate, shape (candidates, units)."""
    totals, sizes = _units(right, instances)
    moved: NDArray[np.float64] = (totals - right.mean(axis=1, keepdims=True) * sizes) / sizes.sum()
    return moved


def _moved(parts: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the rates move if every unit is weighted at random, shape (draws, candidates)."""
    rng = np.random.default_rng(_SEED)
    return np.asarray(rng.standard_normal((DRAWS, parts.shape[1])) @ parts.T)


def _equivalent(quantile: float) -> float:
    """Return the number of comparisons for which Bonferroni's correction has this quantile; at least 1."""
    from scipy.special import ndtr

    return max(1.0, 0.025 / max(float(ndtr(-quantile)), 1e-12))
