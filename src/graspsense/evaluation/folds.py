"""How trials are dealt into folds: each function returns, for every trial, the number of the fold that tests it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from graspsense.core.errors import ConfigError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Folds = NDArray[np.int64]


def stratified(labels: Sequence[str], k: int, seed: int) -> Folds:
    """Deal the trials of each label, shuffled, round and round to the folds.

    Raises ConfigError where there are fewer than two folds, or fewer trials than folds.
    """
    _check(len(labels), k)
    rng = np.random.default_rng(seed)
    folds = np.zeros(len(labels), dtype=np.int64)
    dealt = 0
    for _, rows in _by_label(labels):
        shuffled = rng.permutation(rows)
        # Going on where the label before ended keeps all folds of one size, within one trial.
        folds[shuffled] = (dealt + np.arange(len(shuffled))) % k
        dealt += len(shuffled)
    return folds


def instance_held_out(labels: Sequence[str], instances: Sequence[str], k: int, seed: int) -> Folds:
    """Deal whole instances, so that no trial is tested by a model that knew the very thing it is of.

    Instances are dealt by the label that most of their trials have, so that folds hold about as many of each.
    With fewer instances than folds there are as many folds as instances.
    """
    _check(len(labels), k)
    rng = np.random.default_rng(seed)
    things = sorted(set(instances))
    k = min(k, len(things))
    _check(len(labels), k)
    of = np.array(instances)
    main = [
        commonest([label for label, one in zip(labels, instances, strict=True) if one == thing])
        for thing in things
    ]
    fold_of = np.zeros(len(things), dtype=np.int64)
    dealt = 0
    for _, members in _by_label(main):
        fold_of[rng.permutation(members)] = (dealt + np.arange(len(members))) % k
        dealt += len(members)
    return fold_of[np.searchsorted(np.array(things), of)]


def in_order(labels: Sequence[str], order: Sequence[int], k: int) -> Folds:
    """Cut the trials of each label, in the order of their recording, into `k` blocks that follow one another."""
    _check(len(labels), k)
    folds = np.zeros(len(labels), dtype=np.int64)
    when = np.array(order)
    for _, rows in _by_label(labels):
        sorted_rows = rows[np.argsort(when[rows], kind="stable")]
        folds[sorted_rows] = np.arange(len(rows)) * k // len(rows)
    return folds


def commonest(labels: Sequence[str]) -> str:
    """Return the label that occurs most often, of equals the first by name."""
    counts = Counter(labels)
    most = max(counts.values())
    return min(label for label, n in counts.items() if n == most)


def _by_label(labels: Sequence[str]) -> list[tuple[str, NDArray[np.int64]]]:
    given = np.array(labels)
    return [(str(label), np.flatnonzero(given == label)) for label in np.unique(given)]


def _check(n: int, k: int) -> None:
    if k < 2:
        raise ConfigError(f"{k} fold{'' if k == 1 else 's'}: a cross validation needs at least 2")
    if n < k:
        raise ConfigError(f"{n} trials cannot be cut into {k} folds: give more trials, or fewer --folds")
