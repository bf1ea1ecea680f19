"""Assigning trials to folds: each function returns the number of the fold that tests each trial."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from graspsense.core.components.caller import option
from graspsense.core.learn.labelled import Labelled, Target, class_of
from graspsense.core.values.errors import ConfigError, counted

Folds = NDArray[np.int64]
"""The number of the fold that tests each trial, -1 for a trial that takes no part."""

INSTANCE_HELD_OUT: Final = "instance_held_out"
"""The name of the protocol with folds of whole instances."""
GROUP_HELD_OUT: Final = "group_held_out"
"""The name of the protocol with folds of trials that belong together, of objects that are not named."""


def held_out_protocol(trials: Labelled) -> str:
    """Return the name of the protocol that holds out the instances of these trials."""
    return GROUP_HELD_OUT if trials.grouped else INSTANCE_HELD_OUT


def held_out_words(trials: Labelled, k: int) -> str:
    """Return what `k` folds of the instances of these trials are."""
    if trials.grouped:
        return f"at most {k} folds of trials that belong together, by their values: the objects are not named"
    return f"at most {k} folds of whole instances: no model was trained on the instance that it is tested on"


def splits(
    folds: Folds, within: NDArray[np.int64] | None = None
) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int64]]]:
    """Yield the trials of each fold, and those to train for it; none for a fold without any.

    With `within`, only trials with the same number in it are trained for each other; they share no fold with others.
    """
    for fold in np.unique(folds[folds >= 0]).tolist():
        test = np.flatnonzero(folds == fold)
        others = (folds >= 0) & (folds != fold)
        if within is not None:
            others &= within == within[test[0]]
        if others.any():
            yield test, np.flatnonzero(others)


def stratified(labels: Sequence[str], k: int, seed: int) -> Folds:
    """Assign the shuffled trials of each label to the folds in turn.

    Raises ConfigError for fewer than two folds, or fewer trials than folds.
    """
    check_folds(len(labels), k)
    rng = np.random.default_rng(seed)
    folds = np.zeros(len(labels), dtype=np.int64)
    assigned = 0
    for _, rows in _by_label(labels):
        shuffled = rng.permutation(rows)
        # Continuing where the previous label ended keeps the sizes of all folds equal to within one trial.
        folds[shuffled] = (assigned + np.arange(len(shuffled))) % k
        assigned += len(shuffled)
    return folds


def instance_held_out(labels: Sequence[str], instances: Sequence[str], k: int, seed: int) -> Folds:
    """Assign whole instances, so that no model was trained on the object that it is tested on.

    Instances are stratified by the most frequent label of their trials. If there are fewer instances than folds,
    there are as many folds as instances.
    """
    check_folds(len(labels), k)
    labels_of: dict[str, list[str]] = {name: [] for name in sorted(set(instances))}
    for label, instance in zip(labels, instances, strict=True):
        labels_of[instance].append(label)
    fold_of = stratified([*map(commonest, labels_of.values())], min(k, len(labels_of)), seed)
    return fold_of[np.searchsorted(np.array([*labels_of]), np.array(instances))]


def held_out(labels: Sequence[str], instances: Sequence[str] | None, k: int, seed: int) -> Folds:
    """Assign whole instances where they are given, else trials, to at most `k` folds."""
    k = min(k, len(labels))
    if instances is None:
        return stratified(labels, k, seed)
    return instance_held_out(labels, instances, k, seed)


def in_order(labels: Sequence[str], order: Sequence[int], k: int) -> Folds:
    """Split the trials of each label into `k` consecutive blocks in the order of recording."""
    check_folds(len(labels), k)
    folds = np.zeros(len(labels), dtype=np.int64)
    when = np.array(order)
    for _, rows in _by_label(labels):
        sorted_rows = rows[np.argsort(when[rows], kind="stable")]
        folds[sorted_rows] = np.arange(len(rows)) * k // len(rows)
    return folds


def commonest(labels: Sequence[str]) -> str:
    """Return the most frequent label; of several, the first in alphabetical order."""
    counts = Counter(labels)
    most = max(counts.values())
    return min(label for label, n in counts.items() if n == most)


def _by_label(labels: Sequence[str]) -> list[tuple[str, NDArray[np.int64]]]:
    given = np.array(labels)
    return [(str(label), np.flatnonzero(given == label)) for label in np.unique(given)]


def check_folds(n: int, k: int) -> None:
    """Raise ConfigError if `n` trials cannot be split into `k` folds."""
    if k < 2:
        raise ConfigError(f"{counted(k, 'fold')}: cross validation needs at least 2")
    if n < k:
        raise ConfigError(
            f"{counted(n, 'trial')} cannot be split into {k} folds: give more trials, or fewer folds "
            f"({option('folds')})"
        )


def trials_by_class(labels: Sequence[str], target: Target) -> list[NDArray[np.int64]]:
    """Return the trials that are cross-validated separately: those of each class if the target is `state`."""
    if target != "state":
        return [np.arange(len(labels))]
    classes = np.array([class_of(label) for label in labels])
    return [np.flatnonzero(classes == name) for name in np.unique(classes)]
