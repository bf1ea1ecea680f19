"""The best cut of each of many sorted runs: J48's scan, without scanning."""

from __future__ import annotations

import numpy as np

from graspsense_c45.arithmetic import Array

NOT_ADMISSIBLE = -(2**62)
_ADMISSIBLE = -(2**60)


def best_cuts(
    scores: Array, starts: Array, lengths: Array, offset: Array, tolerance: Array, zero: Array
) -> Array:
    """The position J48's scan ends on in each run, or -1.

    The scan takes a cut when its numerator beats the best one so far (at first: none, 0) by more than the tolerance.
    ``scores + offset`` are the numerators (a score of NOT_ADMISSIBLE marks what is no cut), ``starts`` and ``lengths``
    the runs, which are not empty and in order; a numerator below ``zero`` counts as 0. All are integers.

    The result is nearly always the first cut within the tolerance of the maximum. It is not where an earlier cut is
    within the tolerance of that one; these runs are scanned.
    """
    result = np.full(starts.shape, -1, dtype=np.int64)
    highest = np.maximum.reduceat(scores, starts)
    good = (highest > _ADMISSIBLE) & (highest + offset > tolerance) & (highest + offset >= zero)
    # Whatever can matter: within twice the tolerance of the maximum.
    floor = np.where(good, highest - 2 * tolerance, np.iinfo(np.int64).max)
    near = np.flatnonzero(scores >= np.repeat(floor, lengths))
    run = np.searchsorted(starts, near, side="right") - 1
    score = scores[near]
    top = np.flatnonzero(score >= (highest - tolerance)[run])
    top = top[np.concatenate(([True], run[top][1:] != run[top][:-1]))] if top.size else top
    result[run[top]] = near[top]
    # Doubtful: something before the first top cut comes near it, or that cut itself is hardly better than none.
    first_score = np.zeros(starts.shape, dtype=np.int64)
    first_score[run[top]] = score[top]
    before = (near < result[run]) & (score >= (first_score - tolerance)[run])
    doubtful = np.zeros(starts.shape, dtype=bool)
    doubtful[run[before]] = True
    doubtful |= good & ((first_score + offset <= tolerance) | (first_score + offset < zero))
    for i in np.flatnonzero(doubtful):
        run_scores = scores[starts[i] : starts[i] + lengths[i]]
        result[i] = _scan(run_scores, int(starts[i]), int(offset[i]), int(tolerance[i]), int(zero[i]))
    return result


def _scan(scores: Array, start: int, offset: int, tolerance: int, zero: int) -> int:
    """The scan itself, over the records of the run (nothing else can be taken)."""
    running = np.maximum.accumulate(scores)
    records = np.flatnonzero(np.concatenate(([True], running[1:] > running[:-1])))
    best, taken = 0, -1
    for record, score in zip(records.tolist(), running[records].tolist(), strict=True):
        numerator = score + offset
        if numerator - best > tolerance and numerator >= zero:
            best, taken = numerator, start + record
    return taken
