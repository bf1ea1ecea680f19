"""The best cut of each of many sorted runs of rows, without scanning them one by one."""

from __future__ import annotations

import numpy as np

from graspsense_c45.arrays import FixedPoint, Indices
from graspsense_c45.criteria import is_better_cut

NOT_ADMISSIBLE = -(2**62)
"""The score of a position at which no cut is admissible."""
_ADMISSIBLE = -(2**60)


def best_cuts(
    scores: FixedPoint,
    starts: Indices,
    lengths: Indices,
    offset: FixedPoint,
    tolerance: FixedPoint,
    least: FixedPoint,
) -> Indices:
    """Return the position that J48's scan ends on in each run, or -1.

    The scan takes a cut where `criteria.is_better_cut` holds for its numerator and the best one so far. ``scores +
    offset`` are the numerators; `starts` and `lengths` are the runs, which are in order and not empty.
    `depthfirst.scanning` scans; `tests/test_laws.py` and `tests/test_engines.py` compare the results.

    The result is nearly always the first cut within the tolerance of the maximum. It is another one where an earlier
    cut is within the tolerance of that one; such runs are scanned.
    """
    result = np.full(starts.shape, -1, dtype=np.int64)
    highest = np.maximum.reduceat(scores, starts)
    good = (highest > _ADMISSIBLE) & (highest + offset > tolerance) & (highest + offset >= least)
    # Only cuts within twice the tolerance of the maximum can matter.
    floor = np.where(good, highest - 2 * tolerance, np.iinfo(np.int64).max)
    near = np.flatnonzero(scores >= np.repeat(floor, lengths))
    run = np.searchsorted(starts, near, side="right") - 1
    score = scores[near]
    top = np.flatnonzero(score >= (highest - tolerance)[run])
    top = top[np.concatenate(([True], run[top][1:] != run[top][:-1]))] if top.size else top
    result[run[top]] = near[top]
    # Doubtful: a cut before the first top cut comes near it, or the top cut itself is hardly better than none.
    first_score = np.zeros(starts.shape, dtype=np.int64)
    first_score[run[top]] = score[top]
    before = (near < result[run]) & (score >= (first_score - tolerance)[run])
    doubtful = np.zeros(starts.shape, dtype=bool)
    doubtful[run[before]] = True
    doubtful |= good & ((first_score + offset <= tolerance) | (first_score + offset < least))
    for i in np.flatnonzero(doubtful):
        run_scores = scores[starts[i] : starts[i] + lengths[i]]
        result[i] = _scan(run_scores, int(starts[i]), int(offset[i]), int(tolerance[i]), int(least[i]))
    return result


def _scan(scores: FixedPoint, start: int, offset: int, tolerance: int, least: int) -> int:
    """Scan a run. Only scores above all earlier ones are looked at, since no other can be taken."""
    running = np.maximum.accumulate(scores)
    records = np.flatnonzero(np.concatenate(([True], running[1:] > running[:-1])))
    best, chosen = 0, -1
    for record, score in zip(records.tolist(), running[records].tolist(), strict=True):
        if is_better_cut(score + offset, best, tolerance, least):
            best, chosen = score + offset, start + record
    return chosen
