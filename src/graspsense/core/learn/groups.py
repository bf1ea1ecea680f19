"""Trials that belong together, although no instance says so: they are held out together, as those of one object are.

Near copies: rounded, shifted or noisy copies of a trial have no equal features. What gives them away is their number.
Of trials drawn independently, with features that all follow one number, a fifth are five times closer to one trial than
to the next one, and fewer if there are more numbers to follow. More than that are copies, or grasps of one object.

Neighbours: where no instances are named, trials of a label that follow each other may be more alike than others, as
grasps of one object, windows of one recording and a drifting sensor make them. They are held out in blocks, whose
length is doubled as long as neighbouring blocks are alike.

Clumps: of trials in another order, two signs together tell. The nearest trials have the same label far more often than
others close by, and trials are closer to each other than to trials drawn from the spread around them. So are windows of
one recording, and grasps of one object. Each label is then held out in parts of trials close to each other, as in block
cross-validation (D. R. Roberts et al., Ecography 40 (2017) 913).

Numbers to predict: trials with the same finely measured number, which chance hardly repeats, are of one object.

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
from graspsense.core.learn.labelled import class_of
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
_NEAREST: Final = 1e-7
"""Distances, in standard deviations, below which the difference of two squares is not known."""
_PERMUTATIONS: Final = 199
_ALIKE: Final = 3.5
"""Standard deviations by which neighbours are more alike than trials in random order, if they belong together."""
_STILL_ALIKE: Final = 2.0
"""The same for blocks, once it is known that neighbours are alike."""
_FEWEST_BLOCKS: Final = 4
"""Blocks of a label from which on it can be told whether neighbouring ones are alike."""
_FEWEST_CLUMPED: Final = 12
"""Trials of a label from which on it can be told whether they are in clumps."""
_LARGEST_CLUMP: Final = 25
"""Trials of a clump up to which it may be a recording or an object; larger ones are kinds of their label."""
_CLUMPED: Final = (3.0, 2.0)
"""Standard deviations by which near trials have the label more often, and are closer, than others, if in clumps."""
_SECOND: Final = 1
"""Place of the nearest distance by which clumps are told, so that pairs, as copies with noise, are none."""
_LESS_FAR: Final = 0.8
"""Share of the agreement of the labels, beyond chance, that is lost outside a clump."""
_SURE: Final = 30.0
"""Equal numbers to predict to be found for each one that is expected by chance, if they are of one object."""
_USUAL: Final = 3.0
"""Times as many trials as half of the numbers have, from which on a number is usual."""
_ROUNDING: Final = 1e-9
"""Differences below this share of a range are rounding errors."""
_PARTS: Final = 10
"""Parts of each label that are held out, if its trials are in clumps: ten folds."""


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
        group_of, why = _together(labelled, np.concatenate(links, axis=1))
        if why:
            links.append(_to_the_first(group_of))
            notes.append(
                f"{why} are held out as if of one object: grasps of one object, windows of one recording, and drift "
                f"are so. Name the objects or sessions ({option('instance', 'COLUMN')})"
            )
    if not notes and not copies.size:
        return labelled
    named = labelled.instances or [f"group of trial {k + 1}" for k in range(len(labelled))]
    return evolve(
        labelled,
        instances=tuple(named[k] for k in _joined(np.concatenate(links, axis=1), len(labelled))),
        grouped=labelled.instances is None,
        notes=(*labelled.notes, *notes),
    )


def _together(labelled: Labelled, copies: Numbers) -> tuple[Numbers, str]:
    """Return the group of each trial, and in words which trials belong together besides copies; empty if none do."""
    if labelled.value is not None:
        return _of_one_number(np.array(labelled.value.values))
    length, block_of = _blocks(labelled)
    if length > 1:
        words = f"trials of a label that follow each other are more alike than others. Blocks of {length}"
        return block_of, words
    part_of = _parts(labelled, copies)
    if part_of is None:
        return block_of, ""
    return part_of, f"trials of a label are in clumps that are alike. {_PARTS} parts of each label"


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


def _joined(pairs: Numbers, n: int) -> list[int]:
    """Return for each of `n` trials the first one that these pairs join it to."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    joined = coo_array((np.ones(pairs.shape[1]), (pairs[0], pairs[1])), shape=(n, n))
    _, component_of = connected_components(joined, directed=False)
    joined_to: list[int] = _to_the_first(component_of.astype(np.int64))[1].tolist()
    return joined_to


def _near_copies(labelled: Labelled) -> tuple[Numbers, list[str]]:
    """Return pairs of trials that are much closer to each other than to the rest, and a note on them, if any.

    Trials of one named instance may be close.
    """
    pairs: list[Numbers] = [np.empty((2, 0), dtype=np.int64)]
    values = _scaled(labelled.table.values)
    if not 2 * _MOST_OTHERS < len(labelled) <= _MOST_TRIALS or values.shape[1] < 2:
        return pairs[0], []
    apart = _distances(values, values)
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
        judged = (near > _NEAREST) & np.isfinite(next_one)
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


def _distances(values: Values, others: Values) -> Values:
    """Return the distance of each trial to each of the others."""
    squares = (values**2).sum(axis=1)[:, np.newaxis] + (others**2).sum(axis=1)
    distances: Values = np.sqrt(np.maximum(squares - 2.0 * values @ others.T, 0.0))
    return distances


def _parts(labelled: Labelled, copies: Numbers) -> Numbers | None:
    """Return the part of its label that each trial is in, if trials are in clumps, besides these pairs of copies."""
    from scipy.cluster.hierarchy import fcluster, ward

    values = _scaled(labelled.table.values)
    codes = np.unique(np.array(labelled.labels), return_inverse=True)[1]
    if len(codes) > _MOST_TRIALS or values.shape[1] < 2 or not _in_clumps(values, codes, copies):
        return None
    part_of = np.zeros(len(codes), dtype=np.int64)
    for code, size in enumerate(np.bincount(codes).tolist()):
        rows = np.flatnonzero(codes == code)
        part_of[rows] = fcluster(ward(values[rows]), _PARTS, "maxclust") if size > _PARTS else np.arange(size)
    return codes * len(codes) + part_of


def _in_clumps(values: Values, codes: Numbers, copies: Numbers) -> bool:
    """Return whether near trials have the same label, and are close, more than smooth distributions make them.

    The first is M. F. Schilling's count of neighbours (J. Am. Stat. Assoc. 81 (1986) 799), of the two nearest and of
    others; the second compares distances as B. Hopkins and J. G. Skellam do (Ann. Bot. 18 (1954) 213), with points
    drawn from the normal distribution of the third of a label that is around a trial.
    """
    apart = _distances(values, values)
    np.fill_diagonal(apart, np.inf)
    apart[copies[0], copies[1]] = apart[copies[1], copies[0]] = np.inf
    sizes = np.bincount(codes)
    many = sizes >= _FEWEST_CLUMPED
    if many.sum() < 2:
        return False
    fewest, judged = int(sizes[many].min()), many[codes]
    begin = min(fewest // 4, _LARGEST_CLUMP)
    same = codes[np.argsort(apart, axis=1, kind="stable")] == codes[:, np.newaxis]
    near, far = same[:, :2].mean(axis=1), same[:, begin : begin + max(fewest // 12, 1)].mean(axis=1)
    by_chance = (sizes[codes] - 1.0) / (len(codes) - 1.0)
    # Each label weighs as much as any other.
    weights = judged / sizes[codes] / many.sum()
    near_beyond, far_beyond = (float(weights @ (share - by_chance)) for share in (near, far))
    spread = math.sqrt(float(weights**2 @ (near - far - near_beyond + far_beyond) ** 2))
    if far_beyond > _LESS_FAR * near_beyond or near_beyond - far_beyond <= _CLUMPED[0] * spread:
        return False
    rng = np.random.default_rng(0)
    closer = np.concatenate(
        [
            _closer(values[codes == code], apart[np.ix_(codes == code, codes == code)], rng)
            for code in np.flatnonzero(many)
        ]
    )
    return bool(closer.mean() * math.sqrt(len(closer)) > _CLUMPED[1] * closer.std())


def _closer(values: Values, apart: Values, rng: np.random.Generator) -> Values:
    """Return the logarithm of how many times closer the second other trial is to each one than to a point around it."""
    n = len(values)
    around = np.argsort(apart, axis=1, kind="stable")[:, : n // 3 - 1]
    around = np.column_stack([np.arange(n), around])
    drawn = rng.normal(size=around.shape)
    shares = (drawn - drawn.mean(axis=1, keepdims=True)) / math.sqrt(around.shape[1] - 1.0)
    weights = np.zeros((n, n))
    np.put_along_axis(weights, around, shares + 1.0 / around.shape[1], axis=1)
    to_a_trial, to_a_point = (
        np.clip(np.partition(distances, _SECOND, axis=1)[:, _SECOND], _NEAREST, 1.0 / _NEAREST)
        for distances in (apart, _distances(weights @ values, values))
    )
    closer: Values = np.log(to_a_point / to_a_trial)
    return closer


def _scaled(values: Values) -> Values:
    """Return the features without missing values, those with the most different ones, by their standard deviation."""
    whole = values[:, ~np.isnan(values).any(axis=0)]
    finest = np.argsort([-len(np.unique(column)) for column in whole.T], kind="stable")[:_MOST_FEATURES]
    whole = whole[:, finest] - whole[:, finest].mean(axis=0)
    spread = whole.std(axis=0)
    scaled: Values = whole[:, spread > 0.0] / spread[spread > 0.0]
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


def _blocks(labelled: Labelled) -> tuple[int, Numbers]:
    """Return the length of the blocks in which trials of a label are alike, and the block of each trial.

    The length is 1 if they are not, and if the trials are sorted by a feature. Each label has two blocks at least.
    """
    times = np.arange(len(labelled)) if labelled.order is None else np.array(labelled.order)
    codes = np.unique(np.array(labelled.labels), return_inverse=True)[1]
    in_time = np.lexsort((times, codes))
    codes, values = codes[in_time], labelled.table.values[in_time]
    sizes = np.bincount(codes)
    place = np.arange(len(codes)) - (np.cumsum(sizes) - sizes)[codes]
    length, block_of = 1, np.arange(len(codes))
    limit = np.inf if _is_sorted(values, codes) else _ALIKE
    while _likeness(means_of(values, block_of), codes[np.unique(block_of, return_index=True)[1]]) > limit:
        length, limit = 2 * length, _STILL_ALIKE
        block_of = codes * len(codes) + place // np.minimum(length, (sizes + 1) // 2)[codes]
    result = np.empty_like(block_of)
    result[in_time] = block_of
    return length, result


def _is_sorted(values: Values, codes: Numbers) -> bool:
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
    from scipy.stats import rankdata

    ranks = np.zeros(means.shape)
    for code in np.unique(codes).tolist():
        rows = codes == code
        if rows.sum() >= _FEWEST_BLOCKS:
            placed = rankdata(means[rows], axis=0, nan_policy="omit") / rows.sum()
            known = np.maximum((~np.isnan(placed)).sum(axis=0), 1)
            ranks[rows] = np.nan_to_num(placed - np.nansum(placed, axis=0) / known)
    rng = np.random.default_rng(0)
    by_chance = [statistic(ranks[np.lexsort((rng.random(len(codes)), codes))]) for _ in range(_PERMUTATIONS)]
    spread = float(np.std(by_chance))
    return (statistic(ranks) - float(np.mean(by_chance))) / spread if spread > 0.0 else 0.0
