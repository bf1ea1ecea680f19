"""The folds and orders of Weka, so that a cross validation can be compared row by row.

Source: java.util.Random (Java SE API documentation: a 48-bit linear congruential generator);
weka.core.Instances 3.9.6: randomize, stratify, trainCV, testCV.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from graspsense_c45.arrays import Indices

_MULTIPLIER = 0x5DEECE66D
_MASK = (1 << 48) - 1


class JavaRandom:
    """java.util.Random: the same integers for the same seed."""

    def __init__(self, seed: int) -> None:
        self._state = (seed ^ _MULTIPLIER) & _MASK

    def next_int(self, bound: int) -> int:
        """Return an integer in 0..bound-1, as nextInt(bound). Raises ValueError for a bound outside 1..2147483647."""
        if not 0 < bound <= 2**31 - 1:
            raise ValueError(f"bound is {bound}; it must be in 1..2147483647")
        if bound & (bound - 1) == 0:
            return (bound * self._next(31)) >> 31
        while True:
            bits = self._next(31)
            value = bits % bound
            if bits - value + (bound - 1) < 2**31:
                return value

    def shuffle(self, order: list[int]) -> None:
        """Shuffle in place, as Weka's randomize: from the end, each place is exchanged with one at or before it."""
        for last in range(len(order) - 1, 0, -1):
            other = self.next_int(last + 1)
            order[last], order[other] = order[other], order[last]

    def _next(self, bits: int) -> int:
        self._state = (self._state * _MULTIPLIER + 0xB) & _MASK
        return self._state >> (48 - bits)


class Fold(NamedTuple):
    """A fold: the training rows in the order in which Weka trains on them, and the test rows in order."""

    train: Indices
    test: Indices


def stratify(labels: Sequence[int], n_folds: int) -> list[int]:
    """Return an order of the rows whose contiguous blocks hold the classes in proportion (Weka's stratify)."""
    order = list(range(len(labels)))
    begin = 1
    while begin < len(order):
        label = labels[order[begin - 1]]
        for other in range(begin, len(order)):
            if labels[order[other]] == label:
                order[begin], order[other] = order[other], order[begin]
                begin += 1
        begin += 1
    return [row for start in range(n_folds) for row in order[start::n_folds]]


def test_block(n_rows: int, n_folds: int, fold: int) -> range:
    """Return the places of the test rows of a fold: contiguous; the first folds are longer by one where needed."""
    size, remainder = divmod(n_rows, n_folds)
    start = fold * size + min(fold, remainder)
    return range(start, start + size + (1 if fold < remainder else 0))


def hold_out(labels: ArrayLike, n_folds: int) -> Indices:
    """Return the rows that J48 -R -N n_folds holds out: the last stratified fold. No seed enters, only the order of
    rows.

    Raises ValueError if there are fewer rows than folds.
    """
    given = _cuttable(labels, n_folds)
    order = stratify(given, n_folds)
    block = test_block(len(order), n_folds, n_folds - 1)
    return np.array([order[place] for place in block], dtype=np.int64)


def stratified_folds(labels: ArrayLike, n_folds: int = 10, seed: int = 1) -> list[Fold]:
    """Return the folds of Weka's Evaluation.crossValidateModel: shuffle, stratify, shuffle each training set.

    labels: a hashable label for each row.

    Raises ValueError if there are fewer rows than folds.
    """
    given = _cuttable(labels, n_folds)
    random = JavaRandom(seed)
    order = list(range(len(given)))
    random.shuffle(order)
    order = [order[place] for place in stratify([given[row] for row in order], n_folds)]
    folds = []
    for fold in range(n_folds):
        block = test_block(len(order), n_folds, fold)
        train = order[: block.start] + order[block.stop :]
        random.shuffle(train)
        test = order[block.start : block.stop]
        folds.append(Fold(np.array(train, dtype=np.int64), np.array(test, dtype=np.int64)))
    return folds


def _cuttable(labels: ArrayLike, n_folds: int) -> list[int]:
    given: list[int] = np.asarray(labels).tolist()
    if not 2 <= n_folds <= len(given):
        raise ValueError(
            f"n_samples={len(given)} rows cannot be cut into {n_folds} folds; allowed: 2 up to n_samples"
        )
    return given
