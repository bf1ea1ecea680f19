"""Columns that identify trials instead of measuring them: counters, times, dates, numbers of objects.

Trials are often recorded one label after the other, so that such a column reveals the labels, in whatever order the
lines are. A measured column may be distinct in every line as well, and may increase with the labels of a sorted file;
what distinguishes an identifier is that it follows the lines within each label, that it is a calendar date, that its
values lie on a grid and repeat less, or more evenly, than measured ones can, or that their steps are too much alike.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Hashable, Sequence
from datetime import datetime
from itertools import groupby
from typing import TYPE_CHECKING, Final

import numpy as np

from graspsense.core.learn.confounding import LEAST_LINES
from graspsense.core.learn.groups import cells_in_range
from graspsense.core.values.features import LARGEST_VALUE
from graspsense.sources.columns.column_guess import words_of
from graspsense.sources.units import DATES_S, TO_SI

if TYPE_CHECKING:
    from numpy.typing import NDArray

_COUNTED: Final = frozenset(
    ("", "1", "-", "#", "%", "count", "counts", "nr", "no", "id", "index", "none", "n/a")
)
"""What stands in the place of a unit for numbers without one."""
TIMES: Final = frozenset({
    "s", "sec", "secs", "second", "seconds", "ms", "msec", "us", "µs", "ns", "min", "mins", "minute", "minutes",
    "h", "hr", "hrs", "hour", "hours", "d", "day", "days",
})  # fmt: skip
_NAMES: Final = frozenset({
    "id", "uid", "uuid", "index", "idx", "number", "num", "no", "nr", "trial", "run", "row", "line", "record",
    "seq", "sequence", "serial", "counter", "file", "filename", "session", "date", "timestamp", "time",
    "epoch", "nummer", "versuch", "messung", "zeile", "datei", "sitzung", "datum", "zeit", "uhrzeit", "essai",
    "fichier", "heure", "numero", "prueba", "archivo", "fecha", "hora"
})  # fmt: skip
DIVISIONS: Final = frozenset({
    "seed", "trial", "fold", "kfold", "split", "is", "train", "training", "test", "testing", "validation",
    "holdout", "subset", "partition", "rep", "repeat", "repetition", "replicate", "attempt", "try", "take", "iteration",
    "random", "uid", "uuid", "crc", "checksum", "chk", "hash", "sha", "pred", "prediction", "predicted", "prob",
    "probs", "proba", "probability", "softmax", "posterior", "confidence", "certainty", "score", "logit", "likelihood",
    "yhat", "hat", "cluster", "correct",
})  # fmt: skip
"""What trials are told apart and divided by, and what a model said of them."""
_OF_RECORDINGS: Final = DIVISIONS | {
    "session", "operator", "experimenter", "tester", "person", "speaker", "volunteer", "participant", "subject", "user",
    "robot", "host", "lab", "site", "batch", "lot", "block", "series", "group", "round", "run", "cycle", "weekday",
    "day", "doy", "week", "month", "year", "date", "datetime", "file", "filename", "sitzung", "bediener", "proband",
    "datum", "wochentag", "tag", "versuch", "datei", "fichier", "jour", "fecha",
}  # fmt: skip
"""These, and what was the same for several recordings; no gripper measures it."""
_NUMBERED: Final = frozenset({
    "id", "no", "nr", "num", "number", "index", "idx", "name", "code", "of", "or", "the", "in", "for", "used", "set",
    "data", "dataset", "val", "k", "cv", "md", "mask", "flag", "int", "hex",
})  # fmt: skip
_FOLLOWS: Final = 0.95
"""Rank correlation with the lines, within each label, of a counter or a clock."""
_DRIFTS: Final = 0.7
_DRIFTS_NEAR: Final = 0.35
"""The same of a drift with noise, and that within a few lines."""
_SPACED: Final = 30
"""Number of lines from which on a drift with noise shows."""
_TIES: Final = 0.2
"""Share of steps against the order of a counter."""
_COUNTING: Final = 15
"""Number of values from which on they count the trials. Fewer number the repetitions with an object, or levels."""
SURE: Final = 4.0
"""Standard deviations from what drawn values have: of 10 000 columns of them, about five are as far from it."""
FAIRLY: Final = 1.0
"""The same of numbers that are in the range of a clock anyway, or go from label to label as those of one do."""
_REPEATED: Final = 0.02
"""Share of repeated values above which values were rounded so much that their steps are more alike."""
_RATIO: Final = (2.0 * math.log(2.0) - 1.0, 0.28)
"""Mean and standard deviation of the ratio of two exponential steps, the smaller one over the larger one."""
_BY_CHANCE: Final = 0.005
_ORDERS: Final = 10_000
"""Number of orders of the lines within the labels from which on one of them is no chance."""
_EVEN: Final = 0.005
"""Probability that drawn values have numbers of lines as even as those of objects."""
_TWO: Final = 1.9
"""Mean number of lines of objects that have two each, but for those at the ends."""
_HASHED: Final = 1e7
"""Integers from this one on are hashes, if they number objects and are no multiples of 1000."""
_UNRELATED: Final = 0.2
"""Correlation below which `yes` and `no` are no predictions of labels of the same words."""
_TWO_DAYS_S: Final = 172_800.0
NAME_OBJECTS: Final = "name the objects (say so by --instance)"
NUMBER_OBJECTS: Final = "number the objects (name them by --instance)"
NAME_THINGS: Final = "name the objects, which have several labels (say so by --instance)"
OF_OBJECTS: Final = (NAME_OBJECTS, NUMBER_OBJECTS)
"""How the values of a column identify trials that are of the same object."""
_MOST_VALUES: Final = 1.0 / 3.0
"""Share of different texts from which on they are no values of a nominal feature."""
_LONG_WORDS: Final = (
    "(mon|tues?|wed(nes)?|thu(rs)?|fri|sat(ur)?|sun)(day)?|(lun|mar|mer(cre)?|jeu|ven(dre)?)(di)?|sam(edi)?|dim(anche)?|"
    "(mon|diens|donners|frei|sams|sonn)tag|mittwoch|jan(uary?)?|jänner|feb(ruary?)?|mar(ch)?|mär(z)?|apr(il)?|may|mai|"
    "ju[nl][eiy]?|aug(ust)?|sept?(ember)?|o[ck]t(ober)?|nov(ember)?|de[cz](ember)?"
)
_WORDS_OF_DATES: Final = re.compile(f"{_LONG_WORDS}|mo|di|mi|do|fr|sa|so")
"""Days of the week and months, alone."""
_DATE_TEXT: Final = re.compile(
    r"(?=.*\d)(\d{1,4}([-./])\d{1,2}\2\d{1,4})?[t ]?(\d{1,2}(:\d{2}){1,2}(\.\d+)?)?( ?z| ?[+-]\d\d:?\d\d)?|"
    rf"(?=.*\d)(?=.*({_LONG_WORDS}|[ap]\.?m))({_LONG_WORDS}|\d+(st|nd|rd|th)?|[ap]\.?m\.?|utc|gmt|[-\s.,:/_+])+"
)
"""A date or a time of day in small letters, as 2026-11-26, 26.11.2026 14:03, 14:03:22, 26 nov 2026 or 2:03 pm."""
_DAY_FORMS: Final = ("%Y%m%d", "%d%m%Y", "%m%d%Y", "%y%m%d")
_DATES: Final = (*_DAY_FORMS, "%y%m%d%H%M", "%Y%m%d%H%M", "%y%m%d%H%M%S", "%Y%m%d%H%M%S")
_CLOCK_VALUES: Final = (10, 15)
"""Different hundreds, and different last two digits, from which on 142530 and 91205 are times of the day: that no two
digits are above 59 is a chance of one in two thousand."""


def names_a_recording(name: str) -> bool:
    """Return whether a heading says who recorded, when, in which session or with which device.

    >>> names_a_recording("session_id"), names_a_recording("trial"), names_a_recording("robot_force")
    (True, True, False)
    """
    return names_only(name, _OF_RECORDINGS, _NUMBERED)


def names_only(name: str, telling: frozenset[str], further: frozenset[str]) -> bool:
    """Return whether a heading has one of these words, and besides them only further ones."""
    words = set(words_of(name))
    return bool(words & telling) and words <= telling | further


def groups_trials(name: str, values: Sequence[str], instances: Sequence[str] | None = None) -> bool:
    """Return whether a column names sessions, operators or devices that whole instances do not hold out.

    Each of them has several trials, also with several instances. Missing values are empty.
    """
    counts = Counter(filter(None, values))
    pairs = {pair for pair in zip(values, instances or range(len(values)), strict=True) if pair[0]}
    several = len(pairs) > len(counts) > 1 and min(counts.values()) > 1
    return several and names_a_recording(name) and not DIVISIONS & set(words_of(name))


def identifies(
    name: str, unit: str, values: Sequence[float], labels: Sequence[str], order: Sequence[int] | None = None
) -> str:
    """Return how the values of a column identify trials, such as `number the trials`; empty if they measure something.

    `values` are NaN where they are missing. `order` is the position of each line in the order of recording, where that
    is not the order of the lines.
    """
    if not (is_count(unit) or is_time(unit)):
        return ""
    column = np.array(values, dtype=np.float64)
    given = np.flatnonzero(~np.isnan(column))
    column, known = column[given], [labels[i] for i in given.tolist()]
    if len(column) < LEAST_LINES or column.min() == column.max() or np.abs(column).max() > LARGEST_VALUE:
        return ""
    if _is_calendar(column):
        return "are dates or times"
    whole = bool((column == np.floor(column)).all())
    values_of = np.unique(column)
    cells: float = round(cells_in_range(values_of)) + 1
    if cells < len(values_of):  # a value far from the others hides their grid
        cells = math.inf
    hashed = whole and column.max() >= _HASHED and bool((column % 1000.0).any())
    numbers, on_grid = column.tolist(), hashed or cells <= 2.0 * len(values_of)
    # Few values are measured equally often by chance.
    no_chance = are_even([*Counter(numbers).values()]) or in_one_block_each(numbers, known)
    if on_grid and no_chance and name_objects(numbers, known):
        return NUMBER_OBJECTS
    named = bool(_NAMES & set(words_of(name)))
    for lines in [given] if order is None else [given, np.array(order)[given]]:
        if (whole or named or is_time(unit)) and rises(column, lines, known):
            return "follow the order of the lines as a counter or a time does"
    if evenness(column) > SURE:
        return "have equal steps, as those of a clock or a counter"
    no_ties = len(values_of) == len(column)
    if _hardly_repeats(len(column), len(values_of), cells) or (named and whole and no_ties):
        return "number the trials"
    return ""


def text_identifies(texts: Sequence[str], labels: Sequence[str]) -> str:
    """Return how the texts of a column identify trials; empty if they are values of a nominal feature.

    A missing text is empty.
    """
    given = [(text, label) for text, label in zip(texts, labels, strict=True) if text]
    counts = Counter(text for text, _ in given)
    if len(counts) < 2:
        return ""
    if counts.keys() <= set(labels) and not (len(counts) == 2 and _answers_another_question(given)):
        return "are the labels, as those of a prediction are"
    lower = [text.lower() for text in counts]
    of_words = len(counts) > 2 and all(map(_WORDS_OF_DATES.fullmatch, lower))
    if of_words or all(map(_DATE_TEXT.fullmatch, lower)):
        return "are dates or times"
    values, own = [text for text, _ in given], [label for _, label in given]
    hardly = len(counts) > max(2, len(given) * _MOST_VALUES)
    numbered = not hardly and all(re.search(r"\d", text) for text in counts)
    for known, why in ((own, NAME_OBJECTS), (groups_of_labels(values, own), NAME_THINGS)):
        of_one_label = len(set(zip(values, known, strict=True))) == len(counts)
        if name_objects(values, known) or (numbered and of_one_label and _enough_objects(len(counts), known)):
            return why
    return "are texts that hardly repeat, as names of trials, files and remarks do" if hardly else ""


def _answers_another_question(pairs: Sequence[tuple[str, str]]) -> bool:
    """Return whether `yes` and `no` do not follow labels of the same words, by the phi coefficient."""
    text, label = np.array([[word == pairs[0][0] for word in pair] for pair in pairs]).T
    return bool(label.std() > 0.0 and abs(np.corrcoef(text, label)[0, 1]) < _UNRELATED)


def is_count(unit: str) -> bool:
    """Return whether this stands in the place of a unit for numbers without one."""
    return unit.lower() in _COUNTED


def is_time(unit: str) -> bool:
    """Return whether this is a unit of time. Only words can have capitals: S is not the second."""
    return unit in TIMES or (len(unit) > len("min") and unit.lower() in TIMES)


def _is_calendar(column: NDArray[np.float64]) -> bool:
    """Return whether these are times since 1970, or dates written as 20261126.

    No two grasps are recorded within a second, and most come after another within two days. Measured numbers can be as
    large, but their steps are not alike at all.
    """
    values, (low, high) = np.unique(column), DATES_S
    if 2 * len(values) > len(column) and evenness(column) > FAIRLY:
        for times_s in (values * TO_SI["time"][unit] for unit in ("s", "ms", "us", "ns")):
            steps_s = np.diff(times_s)
            within = steps_s.mean() >= 1.0 and np.median(steps_s) <= _TWO_DAYS_S
            if low <= times_s[0] and times_s[-1] <= high and within:
                return True
    if values[0] < 0.0 or (values != np.floor(values)).any():
        return False
    texts = [f"{value:.0f}" for value in values.tolist()]
    if any(all(_is_written_date(text, form) for text in texts) for form in _DATES):
        return True
    hundreds, ends = np.unique(values // 100.0), np.unique(values % 100.0)
    many = len(hundreds) >= _CLOCK_VALUES[0] and len(ends) >= _CLOCK_VALUES[1]
    return many and values[-1] < 240_000.0 and max(ends.max(), (hundreds % 100.0).max()) < 60.0


def _is_written_date(text: str, form: str) -> bool:
    digits = len(datetime(2000, 1, 1).strftime(form))
    try:  # A number has lost the zero of the first nine days or months.
        text = text.zfill(digits) if form.endswith("%Y") and len(text) == digits - 1 else text
        return len(text) == digits and 1970 <= datetime.strptime(text, form).year <= 2100
    except ValueError:
        return False


def rises(values: NDArray[np.float64], lines: NDArray[np.int64], labels: Sequence[str]) -> bool:
    """Return whether all steps of values from line to line go the same way, or nearly all within the labels.

    This is no chance. A counter of a byte begins anew. Of values in any order, the number of steps that rise has a
    twelfth of the number of values as its variance.
    """
    in_time = np.diff(values[np.argsort(lines)])
    if (in_time > 0.0).all() or (in_time < 0.0).all():
        return True
    codes = np.unique(np.array(labels), return_inverse=True)[1]
    in_labels = np.lexsort((lines, codes))
    steps = np.diff(values[in_labels])[np.diff(codes[in_labels]) == 0]
    up, down = int((steps > 0.0).sum()), int((steps < 0.0).sum())
    chance = math.sqrt((up + down + 2 * len(set(labels))) / 12.0)
    one_way = max(up, down) >= (1.0 - _TIES) * (up + down) and abs(up - down) >= 2.0 * SURE * chance
    return one_way and len(np.unique(values)) >= _COUNTING


def follow_lines(values: NDArray[np.float64], labels: Sequence[str]) -> bool:
    """Return whether values hardly leave the order of the lines of a label, or drift with them.

    A drift shows over each label, and within a few lines of it: objects that come one after the other differ from each
    other, and not within their lines.
    """
    given = np.flatnonzero(~np.isnan(values))
    codes = np.unique(np.array(labels)[given], return_inverse=True)[1]
    column, lines, counts = values[given], given.astype(np.float64), np.bincount(codes)
    if sum(map(math.lgamma, counts + 1.0)) < math.log(_ORDERS):
        return False
    within = (_ranks(lines, codes) + (counts[codes] - 1) / 2.0).astype(np.int64)
    parts = np.unique(codes * len(given) + within // LEAST_LINES, return_inverse=True)[1]
    whole, near = (
        np.corrcoef(_ranks(column, groups), _ranks(lines, groups))[0, 1] for groups in (codes, parts)
    )
    drifts = abs(whole) >= _DRIFTS and near * np.sign(whole) >= _DRIFTS_NEAR
    return bool(abs(whole) >= _FOLLOWS or (drifts and len(given) >= _SPACED))


def _ranks(values: NDArray[np.float64], codes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the rank of each value in its group, from the middle of the group; equal ones have their mean rank."""
    pairs = np.stack([codes, values])
    _, places, counts = np.unique(pairs, axis=1, return_inverse=True, return_counts=True)
    ranks = (np.cumsum(counts) - (counts - 1) / 2.0)[places.ravel()]
    means: NDArray[np.float64] = np.bincount(codes, weights=ranks) / np.bincount(codes)
    return ranks - means[codes]


def differs_by_label(values: NDArray[np.float64], labels: Sequence[str]) -> bool:
    """Return whether the values of a label vary by less than half of the variance of all values."""
    known = np.flatnonzero(~np.isnan(values))
    codes = np.unique(np.array(labels)[known], return_inverse=True)[1]
    sizes = np.bincount(codes)
    if len(sizes) < 2 or int(sizes.min()) < LEAST_LINES or np.ptp(values[known]) == 0.0:
        return False
    means = np.bincount(codes, weights=values[known]) / sizes
    return bool(np.var(values[known] - means[codes]) < 0.5 * np.var(values[known]))


def evenness(values: NDArray[np.float64]) -> float:
    """Return by how many standard deviations the steps of values are more alike than those of drawn ones, in any order.

    Neighbouring steps of sorted values that were drawn independently are exponential, whatever their distribution is:
    the smaller one is 2 log 2 - 1 of the larger one on average. Those of a clock, of a counter, and of what adds up
    over the trials are more alike. Where values repeat, they are spread over the cells that they were rounded to.
    """
    rising = np.unique(values)
    if len(rising) < LEAST_LINES or not np.ptp(rising) < math.inf:
        return 0.0
    if len(values) - len(rising) > _REPEATED * len(values):
        cell = np.ptp(rising) / cells_in_range(rising)
        rising = np.sort(np.sort(values) - rising[0] + cell * np.random.default_rng(0).random(len(values)))
    steps = np.maximum(np.diff(rising), np.finfo(float).tiny)
    ratios = np.minimum(steps[1:], steps[:-1]) / np.maximum(steps[1:], steps[:-1])
    return float(ratios.mean() - _RATIO[0]) / _RATIO[1] * math.sqrt(len(ratios))


def _hardly_repeats(n: int, distinct: int, cells: float) -> bool:
    """Return whether values on a grid repeat too rarely to be measured, if all its cells are as frequent."""
    from scipy.special import pdtr

    # The number of ties is about a Poisson variable.
    expected = n + cells * math.expm1(n * math.log1p(-1.0 / cells))
    return bool(pdtr(n - distinct, expected) < _BY_CHANCE)


def name_objects(values: Sequence[Hashable], labels: Sequence[str]) -> bool:
    """Return whether values name objects: each belongs to one label, and all have as many lines, or one block.

    Where two labels meet, an object may have lines of both. As many objects as there are labels may have fewer lines,
    as the last one of each; others may if all have nearly as many.
    """
    counts = Counter(values)
    objects = len(counts)
    among = len(set(labels))
    if not _enough_objects(objects, labels) or len(set(zip(values, labels, strict=True))) >= objects + among:
        return False
    most = max(counts.values())
    fewer = sum(count < most for count in counts.values())
    in_blocks = sum(1 for _ in groupby(values)) == objects
    alike = fewer <= among or are_even([*counts.values()])
    return most > 1 and (alike or (in_blocks and min(counts.values()) > 1))


def groups_of_labels(values: Sequence[Hashable], labels: Sequence[str]) -> list[str]:
    """Return for each line a label that stands for all those that share values with its own one.

    The labels are returned as they are if only one value is shared by those of a group, or if all share some.

    >>> things, labels = ["can1", "can1", "can2", "jar1", "jar2", "jar2"], ["can", "lid", "can", "jar", "jar", "cap"]
    >>> groups_of_labels(things, labels)
    ['can', 'can', 'can', 'jar', 'jar', 'jar']
    """
    group = {label: label for label in labels}
    label_of: dict[Hashable, str] = {}
    for value, label in dict.fromkeys(zip(values, labels, strict=True)):
        kept, joined = group[label_of.setdefault(value, label)], group[label]
        group = {name: kept if head == joined else head for name, head in group.items()}
    several = Counter(group[label] for label in label_of.values())
    apart = len(several) > 1 and min(several.values()) > 1
    return [group[label] if apart else label for label in labels]


def are_even(counts: Sequence[int]) -> bool:
    """Return whether values have numbers of lines as even as those of objects, by a chi-squared test."""
    from scipy.special import gammainc

    mean = sum(counts) / len(counts)
    uneven = (1.0 + sum((count - mean) ** 2 for count in counts)) / mean  # to the middle of the next sum
    return mean > _TWO and bool(gammainc(0.5 * (len(counts) - 1), 0.5 * uneven) < _EVEN)


def _enough_objects(objects: int, labels: Sequence[str]) -> bool:
    """Return whether there are more objects than a feature has values that tell the labels apart."""
    return objects >= max(LEAST_LINES, 2 * len(set(labels)) + 1)


def in_one_block_each(values: Sequence[Hashable], labels: Sequence[str]) -> bool:
    """Return whether the lines of each value come one after the other, and tell of the label.

    They are several, or it is no chance that those of a label are so, if all orders of its lines are equally likely.
    """
    lines, pairs = Counter(values), Counter(zip(values, labels, strict=True))
    if not 1 < len(lines) == sum(1 for _ in groupby(values)) or len(pairs) == len(lines) * len(set(labels)):
        return False
    orders = sum(math.lgamma(n + 1) for n in Counter(labels).values())
    in_blocks = sum(math.lgamma(n + 1) for n in Counter(label for _, label in pairs).values())
    in_blocks += sum(math.lgamma(n + 1) for n in pairs.values())
    return min(lines.values()) >= LEAST_LINES or orders - in_blocks > math.log(_ORDERS)
