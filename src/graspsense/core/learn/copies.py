"""Copies among trials: the same grasp twice is one trial, whatever it is called and wherever it was read from.

A copy in training and test data at once makes every rate too high, and every interval too narrow. Trials are copies
of each other if their recordings are equal, or if all of their features are. Features that are counted, or rounded
coarsely, can be equal by chance; such trials are kept, and a note says so. Trials that agree in half of their finely
measured features, as edited copies do, are held out together.

Rounded, shifted or noisy copies have no equal features: `learn.groups` finds them.
"""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve

from graspsense.core.learn.groups import cells_in_range, grouped, joined, tail, with_sessions
from graspsense.core.learn.labelled import Labelled
from graspsense.core.values.errors import ConfigError, counted
from graspsense.core.values.features import misfit
from graspsense.core.values.nominal import with_codes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.values.features import FeatureTable

_SURE: Final = 10.0
"""Equal pairs to be found for each one that is expected by chance."""
_COMPARED: Final = 32
"""Features that are compared with each other, those with the most values."""
_HASH_DIGITS: Final = 12
"""Two of a million different trials have the same hash with a probability below 1 in 500."""
_BY_CHANCE: Final = 1e-3
"""Probability that trials which agree in half of their features are no copies."""
_OFTEN: Final = 3
"""Most lines of a zero, or of the end of a range, that are no sign of a limit."""
_SAME: Final = 0.99
"""Correlation of the ranks of two features from which on they are the same one in other units or digits."""
_FEW: Final = 5
"""With fewer different values than this, their differences do not show the resolution of a column."""


def without_copies(labelled: Labelled) -> Labelled:
    """Return the trials without copies of others, with a note on what is left out.

    Of several copies, the one with the fewest missing features is kept; of these, the first.
    """
    labelled = with_sessions(labelled)
    original, by_chance = _originals(labelled.table, labelled.content)
    left_out = np.flatnonzero(original != np.arange(len(labelled)))
    notes = list(labelled.notes)
    if by_chance:
        notes.append(
            f"{counted(by_chance, 'trial has', 'trials have')} exactly the features of another one. They count, "
            "since counted or rounded features can be equal by chance: make sure that no trial is in the data twice"
        )
    kept = np.flatnonzero(original == np.arange(len(labelled)))
    if len(left_out):
        notes.append(_left_out(labelled, left_out, original))
    edited = _edited_copies(with_codes(labelled.table)[1][kept])
    if edited.size:
        row, copy = (int(kept[k]) + 1 for k in edited[:, 0])
        notes.append(
            f"trials that have half of the features of another one, or more: {len(set(edited[1].tolist()))} (trial "
            f"{copy}, of trial {row}). They are held out together: make sure that they are no copies with values that "
            "were changed"
        )
    remaining = labelled.rows(kept) if len(left_out) else labelled
    noted = labelled if len(notes) == len(labelled.notes) else evolve(remaining, notes=tuple(notes))
    return noted if labelled.provenance.get("simulated") else grouped(noted, edited)


def apart_from(tested: Labelled, training: Labelled) -> Labelled:
    """Return the trials of `tested` with the features of `training`, without those that are copies of its trials.

    A note tells of the copies. Raises ConfigError if there are no other trials, if a feature is missing or in another
    unit.
    """
    names, units = training.table.names, training.table.units
    if why := misfit(f"what learns from {training.source}", names, units, tested.table):
        raise ConfigError(f"{tested.source} cannot be tested on: {why}")
    table = tested.table.columns(names)
    tested = evolve(tested, table=table)
    values = np.concatenate([training.table.values, table.values])
    original, _ = _originals(evolve(table, values=values), None)
    n = len(training)
    kept = np.flatnonzero(~np.isin(original[n:], original[:n]))
    if len(kept) == len(tested):
        return tested
    if not len(kept):
        raise ConfigError(
            f"every trial of {tested.source} is a copy of a trial of {training.source}: test on others"
        )
    note = f"{counted(len(tested) - len(kept), 'trial')} to test on left out: copies of trials to learn from"
    return evolve(tested.rows(kept), notes=(*tested.notes, note))


def row_hashes(table: FeatureTable) -> tuple[str, ...]:
    """Return a hash of the features of each trial, by which it is known again in another table."""
    values = table.values + 0.0  # -0.0 and 0.0 are the same number
    values[np.isnan(values)] = np.nan
    return tuple(hashlib.sha256(row.tobytes()).hexdigest()[:_HASH_DIGITS] for row in values)


def learned_from(known: Iterable[str], table: FeatureTable) -> str:
    """Return in words how many of these trials are among those that have the hashes `known`; empty if none is.

    Trials of which a single feature of several is known can have the same value by chance, and do not count.
    """
    hashes, learned = row_hashes(table), frozenset(known)
    telling = (~np.isnan(table.values)).sum(axis=1) >= min(2, len(table.names))
    seen = sum(text in learned for text, tells in zip(hashes, telling.tolist(), strict=True) if tells)
    return f"{seen} of {counted(len(hashes), 'trial')} were learned from" if seen else ""


def _left_out(labelled: Labelled, left_out: NDArray[np.int64], original: NDArray[np.int64]) -> str:
    example = int(left_out[0])
    kept = int(original[example])
    note = (
        f"{counted(len(left_out), 'trial is', 'trials are')} left out as copies of others: a copy is not another trial "
        f"(trial {example + 1} has the same recording or features as trial {kept + 1})"
    )
    other = sum(labelled.labels[i] != labelled.labels[original[i]] for i in left_out.tolist())
    if other:
        note += (
            f". {counted(other, 'of them has', 'of them have')} another label than the trial that is kept: "
            "correct the labels"
        )
    return note


def _originals(table: FeatureTable, content: Sequence[str] | None) -> tuple[NDArray[np.int64], int]:
    """Return the trial that each one is a copy of (itself if of none), and how many are equal perhaps by chance."""
    values = with_codes(table)[1] + 0.0  # -0.0 and 0.0 are the same number
    known = ~np.isnan(values)
    by_content: dict[str, int] = {}
    same = [
        by_content.setdefault(text, i) if text else i for i, text in enumerate(content or [""] * len(table))
    ]
    by_row: dict[bytes, int] = {}
    equal = [by_row.setdefault(row.tobytes(), i) if known[i].any() else i for i, row in enumerate(values)]
    repeated = [i for i, k in enumerate(equal) if same[i] != same[k] and not _known_to_differ(content, i, k)]
    sure: list[int] = []
    unique = np.unique(equal)
    for given in np.unique(known[repeated], axis=0):
        # What is left of trials that lack the same features, as those of stiff objects do, can have few values.
        alike = [i for i in repeated if (known[i] == given).all()]
        like = unique[(known[unique] == given).all(axis=1)]
        distinct = values[like if len(like) >= _FEW else unique][:, given]
        if not _can_be_chance(distinct, len(alike)):
            sure += alike
    pairs = [*enumerate(same), *((i, equal[i]) for i in sure)]
    families = joined(np.array(pairs, dtype=np.int64).T, len(table))
    return _best_of(families, known.sum(axis=1).tolist()), len(repeated) - len(sure)


def _edited_copies(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return pairs of trials, shape (2, pairs), that agree in half of the fine features, which chance hardly makes.

    A feature is fine if no more pairs than there are trials agree in it. It does not follow another one, and at least
    two of them agree. Zeros, and the ends of a range, can be measured often.
    """
    from scipy.special import gammainc

    n, none = len(values), np.empty(0, dtype=np.int64)
    fine: list[NDArray[np.int64]] = []
    for column in _independent(values).T:
        level, lines = np.unique(column[~np.isnan(column)], return_counts=True)
        usual = level[(lines > _OFTEN) & ((level == level[0]) | (level == level[-1]) | (level == 0.0))]
        column = np.where(np.isin(column, usual), np.nan, column)
        order = np.argsort(column, kind="stable")
        ranked, alike, lag = column[order], none, 1
        while len(alike) <= n and (same := ranked[lag:] == ranked[:-lag]).any():
            alike, lag = np.append(alike, order[:-lag][same] * n + order[lag:][same]), lag + 1
        if len(alike) <= n:
            fine.append(alike)
    least = max(2, (len(fine) + 1) // 2)
    pairs, times = np.unique(np.concatenate([none, *fine]), return_counts=True)
    share = (times[times < least].sum() + 1.0) / max(len(fine), 1) / (0.5 * n * n)
    by_chance = 0.5 * n * n * tail(least, len(fine), min(share, 1.0)) if least <= len(fine) else math.inf
    copies = pairs[times >= least]
    if gammainc(len(copies), _SURE * by_chance) > _BY_CHANCE:
        copies = pairs[:0]
    return np.stack([copies // n, copies % n])


def _known_to_differ(content: Sequence[str] | None, i: int, k: int) -> bool:
    """Return whether two recordings were compared and are different, so that equal features are chance."""
    return content is not None and content[i] != "" and content[k] != "" and content[i] != content[k]


def _best_of(families: Sequence[int], known: Sequence[int]) -> NDArray[np.int64]:
    """Return, for each trial, the one of its family with the most features, the first of several."""
    best: dict[int, int] = {}
    for i, family in enumerate(families):
        if family not in best or known[i] > known[best[family]]:
            best[family] = i
    return np.array([best[family] for family in families], dtype=np.int64)


def _can_be_chance(distinct: NDArray[np.float64], repeated: int) -> bool:
    """Return whether so many trials may be equal to others of these different ones by chance.

    They may if the values of all features have few combinations, and where trials often agree in all features but one
    that has few values.
    """
    distinct = _independent(distinct)
    cells = [_values_of(column[~np.isnan(column)]) for column in distinct.T]
    pairs = (len(distinct) + repeated) ** 2 / 2.0
    by_chance = [pairs / math.prod(cells)]
    for left_out, own in enumerate(cells):
        others = Counter(row.tobytes() for row in np.delete(distinct, left_out, axis=1))
        by_chance.append(sum(count * (count - 1) // 2 for count in others.values()) / own)
    return _SURE * max(by_chance) >= repeated


def _values_of(column: NDArray[np.float64]) -> float:
    """Return how many values a column with these may have; of few, only all digits of a calculated number tell it."""
    distinct = np.unique(column)
    if len(distinct) >= _FEW:
        return cells_in_range(distinct)
    digits = (len(repr(value).partition("e")[0].strip("-0.").replace(".", "")) for value in distinct.tolist())
    return max(len(distinct), 10.0 ** (max(digits, default=0) - 6), 1.0)


def _independent(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the finest of these columns without those that follow a finer one, such as a length in another unit."""
    ranks = np.array([np.unique(column, return_inverse=True)[1] for column in values.T], dtype=np.float64)
    ranks = ranks.reshape(values.T.shape)
    highest = ranks.max(axis=1, initial=0.0)
    finest = [k for k in np.argsort(-highest, kind="stable")[:_COMPARED].tolist() if highest[k] > 0.0]
    away = ranks[finest] - ranks[finest].mean(axis=1, keepdims=True)
    away /= np.sqrt((away**2).sum(axis=1, keepdims=True))
    follows = np.triu(np.abs(away @ away.T) >= _SAME, 1).any(axis=0)
    return values[:, [k for k, other in zip(finest, follows.tolist(), strict=True) if not other]]
