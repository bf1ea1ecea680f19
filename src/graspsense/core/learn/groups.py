"""Trials that belong together, although no instance says so: they are held out together, as those of one object are.

Near copies: rounded, shifted or noisy copies of a trial have no equal features. What gives them away is their number.
Of trials drawn independently, with features that all follow one number, a fifth are five times closer to one trial than
to the next one, and fewer if there are more numbers to follow. More than that are copies, or grasps of one object.

Neighbours: where no instances are named, trials of a label that follow each other may be more alike than others, as
grasps of one object, windows of one recording and a drifting sensor make them. They are held out in blocks, whose
length is doubled as long as neighbouring blocks are alike.

Clumps: of trials in another order, their distances may tell (`clumps`).

Numbers to predict: trials with the same finely measured number, which chance hardly repeats, are of one object; so are
clumps of trials with about the same number and features.

Sessions: instances of several classes that are called by the same day or session are no objects of their class.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from itertools import pairwise
from typing import TYPE_CHECKING, Final

import numpy as np
from attrs import evolve

from graspsense.core.components.caller import option
from graspsense.core.learn.clumps import NEAREST, mean_ranks, parts_of_clumps
from graspsense.core.learn.labelled import class_of
from graspsense.core.learn.scaling import mean_and_deviation, scaling_of
from graspsense.core.values.errors import counted

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from graspsense.core.learn.labelled import Labelled

    Numbers = NDArray[np.int64]
    Values = NDArray[np.float64]

_CLOSER: Final = 0.2
"""Ratio of two distances below which a trial is much closer to some trials than to the next one."""
_BY_CHANCE: Final = 1e-6
_MOST_OTHERS: Final = 9
"""Largest number of trials that each trial may be close to: ten grasps of an object are usual."""
_FEWEST_OF_LABEL: Final = 3
"""A label with fewer trials than this times those that are close is a group of its own."""
_MOST_TRIALS: Final = 2000
_MOST_FEATURES: Final = 32
_PERMUTATIONS: Final = 199
_ALIKE: Final = 3.5
"""Standard deviations by which neighbours are more alike than trials in random order, if they belong together."""
_STILL_ALIKE: Final = 2.0
"""The same for blocks, once it is known that neighbours are alike."""
_FEWEST_BLOCKS: Final = 4
"""Blocks of a label from which on it can be told whether neighbouring ones are alike."""
_SURE: Final = 30.0
"""Equal numbers to predict to be found for each one that is expected by chance, if they are of one object."""
_USUAL: Final = 3.0
"""Times as many trials as half of the numbers have, from which on a number is usual."""
_ROUNDING: Final = 1e-9
"""Differences below this share of a range are rounding errors."""


def grouped(labelled: Labelled, copies: Numbers) -> Labelled:
    """Return the trials with groups as their instances, and notes on them, if some of them belong together.

    `copies` are pairs of trials, shape (2, pairs), that do. Named instances are joined where their trials are copies or
    near copies.
    """
    pairs, notes = _near_copies(labelled)
    links = [pairs, copies]
    if labelled.instances is not None:
        links.append(_to_the_first(np.unique(np.array(labelled.instances), return_inverse=True)[1]))
    else:
        group_of, why, clumped = _together(labelled, np.concatenate(links, axis=1))
        name_them = f"Name the objects or sessions ({option('instance', 'COLUMN')})"
        if clumped:
            no_certainty = (
                "of how many objects the clumps of trials are, and so how often other grasps are recognised, cannot be "
                f"told. {name_them}"
            )
            labelled = evolve(labelled, no_certainty=no_certainty)
        if why:
            links.append(_to_the_first(group_of))
            notes.append(
                f"{why} are held out as if of one object: grasps of one object, windows of one recording, and drift "
                f"are so. {name_them}"
            )
    if not notes and not copies.size:
        return labelled
    named = labelled.instances or [f"group of trial {k + 1}" for k in range(len(labelled))]
    return evolve(
        labelled,
        instances=tuple(named[k] for k in joined(np.concatenate(links, axis=1), len(labelled))),
        grouped=labelled.instances is None,
        notes=(*labelled.notes, *notes),
    )


def _together(labelled: Labelled, copies: Numbers) -> tuple[Numbers, str, bool]:
    """Return the group of each trial, in words which belong together besides copies (if any), and if by clumps."""
    values, labels = _scaled(labelled.table.values), labelled.labels
    if labelled.value is not None:
        group_of, why = _of_one_number(np.array(labelled.value.values))
        # The number of an object tells as much of which one it is as all features together.
        number = _scaled(np.array(labelled.value.values)[:, np.newaxis])
        values, labels = np.column_stack([values, math.sqrt(values.shape[1]) * number]), ("",) * len(labels)
    else:
        blocks, group_of = _blocks(labelled)
        alike = "trials of a label that follow each other are more alike than others"
        why = f"{alike}. {blocks}" if blocks else ""
    first_of = np.array(joined(copies, len(labelled)))
    part_of = None if why or len(labelled) > _MOST_TRIALS else parts_of_clumps(values, labels, first_of)
    if part_of is None:
        return group_of, why, False
    return part_of, f"trials are in clumps that are alike. {len(np.unique(part_of))} parts of them", True


def _of_one_number(values: Values) -> tuple[Numbers, str]:
    """Return groups of trials with the same number to predict, as `_together` does, if chance hardly makes them.

    A number that far more trials have than others, such as a zero, may be the end of a range.
    """
    distinct, number_of, trials = np.unique(values, return_inverse=True, return_counts=True)
    usual = trials > _USUAL * np.median(trials)
    repeated = int((trials - 1)[~usual].sum())
    if not repeated or repeated < _SURE * len(values) ** 2 / (2.0 * cells_in_range(distinct)):
        return number_of, ""
    alone = len(distinct) + np.arange(len(values))
    return np.where(usual[number_of], alone, number_of), "trials with the same number to predict"


def with_sessions(labelled: Labelled) -> Labelled:
    """Return the trials with their sessions as instances, and a note, where instances are named by sessions.

    Such a name is no number (`can#3` is the third can), belongs to several classes, and its trials were recorded in one
    stretch. Without the order of recording, only a note tells of such names.
    """
    if labelled.instances is None:
        return labelled
    pairs = [tuple(instance.partition("#")[::2]) for instance in labelled.instances]
    own = [class_of(label) for label in labelled.labels]
    names = [name for _, name in pairs]
    classes: dict[str, set[str]] = {}
    for kind, name in pairs:
        classes.setdefault(name, set()).add(kind)
    if [kind for kind, _ in pairs] != own or any(
        not name or name.isdecimal() or len(kinds) < 2 for name, kinds in classes.items()
    ):
        return labelled
    if labelled.order is None:
        note = (
            f"instances of several classes have the same name, as {names[0]!r}, and count as different objects. If "
            "they are sessions, state the order of recording: then whole sessions are held out"
        )
        return evolve(labelled, notes=(*labelled.notes, note))
    in_time = [names[row] for row in np.argsort(labelled.order, kind="stable").tolist()]
    stretches = 1 + sum(a != b for a, b in pairwise(in_time))
    if stretches > len(classes):
        return labelled
    note = (
        f"instances of several classes have the same name, as {names[0]!r}, and were recorded together: they count "
        "as sessions, and not as objects"
    )
    return evolve(labelled, instances=tuple(names), sessions=True, notes=(*labelled.notes, note))


def _to_the_first(group_of: Numbers) -> Numbers:
    """Return pairs, shape (2, trials), of each trial with the first one of its group."""
    _, begins, column = np.unique(group_of, return_index=True, return_inverse=True)
    return np.stack([np.arange(len(group_of)), begins[column]])


def joined(pairs: Numbers, n: int) -> list[int]:
    """Return for each of `n` trials the first one that these pairs join it to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    links = coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(n, n))
    _, component_of = connected_components(links, directed=False)
    joined_to: list[int] = _to_the_first(component_of.astype(np.int64))[1].tolist()
    return joined_to


def _near_copies(labelled: Labelled) -> tuple[Numbers, list[str]]:
    """Return pairs of trials that are much closer to each other than to the rest, and a note on them, if any.

    Trials of one named instance may be close.
    """
    from scipy.spatial.distance import cdist

    pairs: list[Numbers] = [np.empty((2, 0), dtype=np.int64)]
    values = _scaled(labelled.table.values)
    if not 2 * _MOST_OTHERS < len(labelled) <= _MOST_TRIALS or values.shape[1] < 2:
        return pairs[0], []
    apart = cdist(values, values)
    np.fill_diagonal(apart, np.inf)
    if labelled.instances is not None:
        instances = np.unique(np.array(labelled.instances), return_inverse=True)[1]
        apart[instances[:, np.newaxis] == instances] = np.inf
    of_label = Counter(labelled.labels)
    trials_of_label = np.array([of_label[label] for label in labelled.labels])
    closest = np.argsort(apart, axis=1, kind="stable")[:, : _MOST_OTHERS + 1]
    nearest = np.take_along_axis(apart, closest, axis=1)
    most = 0
    copies: set[int] = set()
    for others in range(1, _MOST_OTHERS + 1):
        near, next_one = nearest[:, others - 1], nearest[:, others]
        judged = (near > NEAREST) & np.isfinite(next_one)
        judged &= trials_of_label > _FEWEST_OF_LABEL * (others + 1)
        close = np.flatnonzero(judged & (near < _CLOSER * next_one))
        if len(close) and tail(len(close), int(judged.sum()), _CLOSER) < _BY_CHANCE:
            most, copies = others, copies | set(close.tolist())
            pairs.append(np.stack([np.repeat(close, others), closest[close, :others].ravel()]))
    if not copies:
        return pairs[0], []
    whom = "another trial" if most == 1 else f"at most {most} other trials"
    named = "of several instances" if labelled.instances is not None else "of one object"
    note = (
        f"{counted(len(copies), 'trial is', 'trials are')} more than five times closer to {whom} than to the next "
        f"one, as copies with other digits and grasps {named} are. They are held out together: leave copies out, and "
        f"name the objects ({option('instance', 'COLUMN')})"
    )
    return np.concatenate(pairs, axis=1), [note]


def _scaled(values: Values) -> Values:
    """Return the features without missing values, those with the most different ones, scaled.

    A trial without any has NaN. Where fewer than two features are without, all count, and a trial with a missing value
    has NaN. If most trials are so, a missing value is that of a trial at random: the same one for all would make trials
    alike.
    """
    known = ~np.isnan(values).all(axis=1)
    whole = values[:, ~np.isnan(values[known]).any(axis=0)]
    if whole.shape[1] < 2:
        whole, rng = values[:, ~np.isnan(values).all(axis=0)], np.random.default_rng(0)
        complete = ~np.isnan(whole).any(axis=1)
        if 2 * complete.sum() > known.sum():
            known = complete
        for column in whole.T:
            missing = np.isnan(column)
            column[missing & known] = rng.choice(column[~missing], int((missing & known).sum()))
    finest = np.argsort([-len(np.unique(column)) for column in whole.T], kind="stable")[:_MOST_FEATURES]
    scaled = scaling_of(whole[:, finest], mean_and_deviation).ready(whole[:, finest])
    scaled[~known] = np.nan
    return scaled


def cells_in_range(distinct: NDArray[np.float64]) -> float:
    """Return how many values fit into the range of these at the resolution that they show."""
    span = float(distinct[-1] - distinct[0])
    step = span
    for distance in (distinct[1:] - distinct[0]).tolist():
        distance = abs(math.remainder(distance, step))
        while distance > _ROUNDING * span:  # Euclid's algorithm
            step, distance = distance, abs(math.remainder(step, distance))
    return span / step


def tail(successes: int, n: int, share: float) -> float:
    """Return the probability of at least so many successes of `n`, each with the probability `share`."""
    from scipy.special import bdtrc

    return float(bdtrc(successes - 1, n, share))


def _blocks(labelled: Labelled) -> tuple[str, Numbers]:
    """Return in words the blocks in which trials of a label are alike, and the block of each trial.

    Where trials of a stretch, between which no other label was recorded, are more alike than others of their label, as
    after a new mounting, blocks are of whole stretches. There are none, and the words are empty, if trials are not
    alike, or are sorted by a feature. Each label has two blocks at least.
    """
    times = np.arange(len(labelled)) if labelled.order is None else np.array(labelled.order)
    codes = np.unique(np.array(labelled.labels), return_inverse=True)[1]
    in_time = np.lexsort((times, codes))
    places = np.argsort(np.argsort(times, kind="stable"))[in_time]
    codes, values = codes[in_time], labelled.table.values[in_time]
    begins = np.flatnonzero(np.r_[True, (np.diff(places) != 1) | (np.diff(codes) != 0)])
    trials = np.diff(np.r_[begins, len(codes)])[:, np.newaxis]

    def within_stretches(ranks: Values) -> float:
        return float((np.add.reduceat(ranks, begins, axis=0) ** 2 / trials).sum())

    limit = np.inf if is_sorted(values, codes) else _ALIKE
    stretches = beyond_chance(values, codes, within_stretches) > limit
    unit_of = np.repeat(np.arange(len(begins)), trials.ravel()) if stretches else np.arange(len(codes))
    of_unit = codes[np.unique(unit_of, return_index=True)[1]]
    sizes = np.bincount(of_unit)
    place = np.arange(len(of_unit)) - (np.cumsum(sizes) - sizes)[of_unit]
    length, block_of, limit = 1, np.arange(len(of_unit)), _STILL_ALIKE if stretches else limit
    while (
        _likeness(means_of(values, block_of[unit_of]), of_unit[np.unique(block_of, return_index=True)[1]])
        > limit
    ):
        length, limit = 2 * length, _STILL_ALIKE
        block_of = of_unit * len(of_unit) + place // np.minimum(length, (sizes + 1) // 2)[of_unit]
    result = np.empty_like(unit_of)
    result[in_time] = block_of[unit_of]
    if stretches:
        return "Stretches" if length == 1 else f"Blocks of {length} stretches", result
    return f"Blocks of {length}" if length > 1 else "", result


def is_sorted(values: Values, codes: Numbers) -> bool:
    """Return whether measured values of a feature rise, or fall, within every label: no trials are recorded so."""
    within = codes[1:] == codes[:-1]
    steps = np.diff(values, axis=0)[within]
    return bool(((steps > 0.0).all(axis=0) | (steps < 0.0).all(axis=0)).any()) and len(steps) > _FEWEST_BLOCKS


def means_of(values: Values, block_of: Numbers) -> Values:
    """Return the mean of each feature in each block of consecutive trials; NaN where all are missing."""
    begins = np.unique(block_of, return_index=True)[1]
    known = np.add.reduceat(~np.isnan(values), begins, axis=0, dtype=np.float64)
    with np.errstate(invalid="ignore"):
        means: Values = np.add.reduceat(np.nan_to_num(values), begins, axis=0) / known
    return means


def _likeness(means: Values, codes: Numbers) -> float:
    """Return by how many standard deviations blocks of a label are more like the next one than in random order.

    It is the sum of the products of their ranks in each feature (A. Wald and J. Wolfowitz, Ann. Math. Stat. 14 (1943)
    378). `codes` number the labels, which come one after the other.
    """
    within = codes[1:] == codes[:-1]
    return beyond_chance(means, codes, lambda ranks: float((ranks[1:] * ranks[:-1])[within].sum()))


def beyond_chance(means: Values, codes: Numbers, statistic: Callable[[Values], float]) -> float:
    """Return by how many standard deviations a statistic is above its mean over permutations within the labels.

    It is computed from the ranks of each feature within a label, as shares about zero. `codes` are as in `_likeness`.
    """
    ranks = np.zeros(means.shape)
    for code in np.unique(codes).tolist():
        rows = codes == code
        if rows.sum() >= _FEWEST_BLOCKS:
            placed = mean_ranks(means[rows]) / rows.sum()
            known = np.maximum((~np.isnan(placed)).sum(axis=0), 1)
            ranks[rows] = np.nan_to_num(placed - np.nansum(placed, axis=0) / known)
    rng = np.random.default_rng(0)
    by_chance = [statistic(ranks[np.lexsort((rng.random(len(codes)), codes))]) for _ in range(_PERMUTATIONS)]
    spread = float(np.std(by_chance))
    return (statistic(ranks) - float(np.mean(by_chance))) / spread if spread > 0.0 else 0.0
