"""Columns that are used as features and may reveal the labels, or that hold more than one kind of number.

No value shows it for certain, so that a note asks the reader. `identifiers` finds the columns that are no features at
all.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from decimal import Decimal
from itertools import chain, groupby, permutations
from operator import itemgetter
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from graspsense.core.components.caller import option
from graspsense.core.learn.confounding import LEAST_LINES, says_the_label
from graspsense.core.values.errors import counted, listed
from graspsense.sources.columns.column_guess import TIME_WORDS, words_of
from graspsense.sources.trial_table.identifiers import (
    DIVISIONS,
    FAIRLY,
    SURE,
    TIMES,
    are_even,
    differs_by_label,
    evenness,
    follow_lines,
    groups_of_labels,
    in_one_block_each,
    is_count,
    is_time,
    name_objects,
    names_only,
)

if TYPE_CHECKING:
    from graspsense.core.learn.target_value import TargetValue
    from graspsense.core.values.features import FeatureTable
    from graspsense.sources.formats.csv_columns import CsvColumns
    from graspsense.sources.formats.table import Numbers

_TIME_NAMES: Final = TIME_WORDS | {"hour", "hours", "minute", "minutes"}
_OF_TIMES: Final = TIMES | {
    "rec", "recorded", "recording", "start", "begin", "end", "at", "of", "day", "since", "total",
}  # fmt: skip
_OF_A_SESSION: Final = frozenset({
    "temperature", "temp", "humidity", "battery", "batt", "vbat", "baseline", "zero", "initial", "start", "before"
})  # fmt: skip
"""What can be the same, or drift, in a whole session, by the name of a column."""
_CHANGES: Final = frozenset({
    "slope", "stiffness", "rate", "rise", "drop", "change", "delta", "cooling", "crossing", "crossings",
})  # fmt: skip
"""What the contact alone shows, by the name of a column; in a unit such as N/m also without it."""
_RESULTS: Final = frozenset({
    "svm", "knn", "nn", "mlp", "cnn", "rf", "lda", "classifier", "model", "output", "out", "margin", "loss", "residual",
    "decision", "result", "outcome", "votes", "pvalue", "pval",
})  # fmt: skip
_OF_RESULTS: Final = DIVISIONS | {"value", "val", "distance", "dist", "function", "rank"}
"""What a model or a test says, by the name of a column."""
_OFTEN: Final = 3
"""Lines with the same value from which on it may stand for something else than a measurement."""
_FROM_ZERO: Final = 0.15
"""Distance from zero of the nearest value, as a share of the range of all, from which on a zero is no measurement."""
_LONE: Final = 100.0
"""How many times the span of all others a single value is away from them, if it is no measurement."""
_FEW: Final = 0.1
"""Share of the lines of a label that may differ from the others in whether they have a value."""
_ROUNDED: Final = 6
"""Most digits of a number that is taken for a rounded one."""
_MOSTLY: Final = 0.75
"""Share of the lines of each label from which on a value may be the setting that this label was recorded with."""
_NEAR: Final = 3.0
"""Standard errors by which the mean of noise is away from zero at most."""
_ROUNDED_SUM: Final = 0.02
"""Largest error of a sum of probabilities."""
_ENOUGH_LINES: Final = 30
_USUAL: Final = 2.0
"""Largest step between two labels over the median step."""
_THOUSAND: Final = 1000.0
_GAP: Final = 100.0
"""Ratio of two neighbouring values between which the unit may change."""
_APART: Final = 0.1
_ALIKE: Final = 1.0 / 3.0
"""Ratios of a pad to the other one below which they are far apart, and above which they are alike."""
_PROPORTIONAL: Final = 1.0 - 1e-6
"""Correlation with the number to predict from which on a column is that number in another unit."""
_DOUBTS: Final[Mapping[str, Mapping[str, str]]] = {
    "If it is the label or a prediction in other words, or a setting of the experiment, it reveals the labels: ": {
        "same": "all or most trials of each label have the same one of its few values",
        "probabilities": "their sum is the same in each line, and most trials of each label have the largest in one "
        "of them",
        "result": "its name is that of the result of a model or a test, or has a label in it",
    },
    "If it tells when, how or with which object a trial was recorded, it reveals the labels: ": {
        "one label": "each of its values occurs with one label only, or with labels that no other shares",
        "blocks": "each of its values is that of consecutive lines, as a month, a session or a version is",
        "missing": "some labels have nearly all of its values, and others hardly any",
        "order": "its values follow the order of recording within each label, as a drifting zero, a battery or a clock "
        "does",
        "time": "its name is that of a time",
        "session": "it is from before the contact, or can drift in a session, by its name or unit",
        "even": "its values have more equal steps than measured ones, also from label to label, as those of a clock or "
        "of what adds up do",
    },
    "Digits tell the labels: round all values alike, or ": {
        "digits": "it is written with fewer digits for some labels than for others",
    },
    "If it is a time or a counter, or is not measured apart from that number, ": {
        "rising": "every line has more than the one before, or every line less",
        "target": "the number to predict determines it, as in another unit or for a known object",
    },
}
"""What to do about a column that may reveal the labels, or the number to predict, by what shows it."""


@np.errstate(over="ignore", invalid="ignore")  # of numbers that no sensor gives
def doubts(
    columns: CsvColumns,
    labels: Sequence[str],
    table: FeatureTable,
    target: TargetValue | None,
    lines: Sequence[int],
) -> list[str]:
    """Return notes on those columns that are features and may reveal the labels, or the number to predict.

    `lines` are those to be looked at, in the order of recording.
    """
    columns, labels = columns.rows(lines), [labels[i] for i in lines]
    used = [name for name in columns.names if set(columns.columns_of(name)) <= set(table.names)]
    numbers = {name: np.array(columns.numbers(name)) for name in used if not columns.is_nominal(name)}
    doubted: dict[str, list[str]] = {}
    for name in used if target is None else numbers:
        if target is not None:
            reasons = _of_target(numbers[name], np.array(target.values)[lines])
        else:
            further = _of_numbers(name, columns.units[name], numbers[name], labels) if name in numbers else ()
            reasons = chain(_of_recording(columns, name, labels), further)
        for reason in reasons:
            doubted.setdefault(reason, []).append(name)
    if target is None:
        doubted["probabilities"] = [*_probabilities(numbers, labels)]
    out = option("features", "-NAME", python="columns")
    notes = [
        f"used, although {what}: {listed(doubted[reason])}. {advice}leave it out ({out})"
        for advice, shown in _DOUBTS.items()
        for reason, what in shown.items()
        if doubted.get(reason)
    ]
    return [*notes, *_mixed(numbers), *_pads_apart(numbers)]


def _of_recording(columns: CsvColumns, name: str, labels: Sequence[str]) -> Iterator[str]:
    """Yield why the texts of a column may tell of labels, devices or objects."""
    cells, nominal, is_number = columns.cells[name], columns.is_nominal(name), is_count(columns.units[name])
    values = columns.texts(name) if nominal else columns.numbers(name)
    coded = not nominal and is_number and is_code(values, labels)
    if coded or says_the_label(cells, labels) or mostly_says_the_label(cells, labels):
        yield "same"
        return
    if mostly_says_the_label([value == "" or value != value for value in values], labels, 1.0 - _FEW):
        yield "missing"
    if name_objects(cells, labels) or (is_number and values_have_one_label(values, labels)):
        yield "one label"
    if (nominal or is_number) and in_one_block_each(cells, labels):
        yield "blocks"


def _of_numbers(name: str, unit: str, values: Numbers, labels: Sequence[str]) -> Iterator[str]:
    """Yield why the numbers of a column may tell of the time of recording, or of how they were written."""
    of_time, differs = is_count(unit) or is_time(unit), differs_by_label(values, labels)
    # Where the lines of a label mostly come one after the other, what drifts can tell labels.
    in_blocks = LEAST_LINES * sum(1 for _ in groupby(labels)) <= len(labels)
    if (differs or in_blocks) and follow_lines(values, labels):
        yield "order"
    if of_time and names_only(name, _TIME_NAMES, _OF_TIMES):
        yield "time"
    if is_count(unit) and is_result(name, labels if differs else ()):
        yield "result"
    words = set(words_of(name))
    state = differs and "/" not in unit and not _CHANGES & words
    if state and (_OF_A_SESSION & words or unit in ("C", "\u00b0C", "degC")):
        yield "session"
    if is_clock(values, labels):
        yield "even"
    if digits_tell_labels(values, labels):
        yield "digits"


def _probabilities(numbers: dict[str, Numbers], labels: Sequence[str]) -> Iterator[str]:
    """Yield as many neighbouring columns as there are labels that are what a model said of each of them."""
    names, n = [*numbers], len(set(labels))
    for begin in range(len(names) - n + 1):
        group = names[begin : begin + n]
        values = np.array([numbers[name] for name in group])
        sums = (values if (values >= 0.0).all() else np.exp(values)).sum(axis=0)
        # Of percentages and of votes, the sum is another number; logarithms are negative.
        wholes = (float(np.median(sums)),) if (values == np.floor(values)).all() else (1.0, 100.0)
        alike = any((np.abs(sums - whole) <= _ROUNDED_SUM * whole).all() for whole in wholes)
        if n > 1 and alike and mostly_says_the_label(values.argmax(axis=0).tolist(), labels):
            yield from group


def _of_target(values: Numbers, target: Numbers) -> Iterator[str]:
    """Yield why the numbers of a column may be the number to predict itself, or when it was measured."""
    steps = np.diff(values)
    if len(steps) >= 2 * LEAST_LINES and ((steps > 0.0).all() or (steps < 0.0).all()):
        yield "rising"
    if follows_from(values, target):
        yield "target"


def mostly_says_the_label(values: Sequence[Hashable], labels: Sequence[str], share: float = _MOSTLY) -> bool:
    """Return whether each label, of lines that are not few, has one of few values in this share of its lines.

    Few lines have another value, as where each label was recorded by its operator or at its level of force.
    """
    counts = Counter(labels)
    pairs = Counter(zip(values, labels, strict=True))
    usual = {label: value for (value, label), n in pairs.items() if n >= share * counts[label]}
    others = sum(n for (value, _), n in pairs.items() if value not in usual.values())
    few = others <= _FEW * len(labels) and min(counts.values()) >= LEAST_LINES
    return few and len(usual) == len(counts) and len(set(usual.values())) > 1


def is_code(values: Sequence[Any], labels: Sequence[str]) -> bool:
    """Return whether the values of each label are a whole number with noise, and these numbers follow each other."""
    codes = np.round(values)
    if np.ptp(codes) != len(np.unique(codes)) - 1 or not says_the_label(codes.tolist(), labels):
        return False
    noise = [np.subtract(values, codes)[codes == code] for code in np.unique(codes)]
    return all(abs(part.mean()) * len(part) ** 0.5 <= _NEAR * part.std() for part in noise)


def is_result(name: str, labels: Sequence[str]) -> bool:
    """Return whether a heading is that of the result of a model or a test, or has a label in it, as `score_can`."""
    words = words_of(name)
    parts = [words_of(label) for label in set(labels)]
    # One or two letters of a label are in a heading by chance.
    of_label = any(len("".join(part)) > 2 and {*part} <= {*words} for part in parts)
    return of_label or "".join(words) in _RESULTS or names_only(name, _RESULTS, _OF_RESULTS)


def digits_tell_labels(values: Numbers, labels: Sequence[str]) -> bool:
    """Return whether the values of a label, which are not few, have fewer digits than most of another label.

    Only digits that were rounded count, and not those of numbers of another magnitude.
    """
    known = np.flatnonzero(~np.isnan(values))
    written = [Decimal(repr(value)).normalize().as_tuple() for value in values[known].tolist()]
    places_and_digits = np.array([(-int(number.exponent), len(number.digits)) for number in written])
    rows_of = [np.flatnonzero(np.array(labels)[known] == label) for label in set(labels)]
    judged = [
        rows for rows in rows_of if len(rows) >= LEAST_LINES and len(np.unique(values[known][rows])) >= _OFTEN
    ]
    pairs = permutations([places_and_digits[rows] for rows in judged], 2)
    return any(
        (coarse.max(axis=0) < np.minimum(fine.max(axis=0), (np.inf, _ROUNDED))).all()
        and float((fine[:, 0] > coarse[:, 0].max()).mean()) > 0.5
        for coarse, fine in pairs
    )


def values_have_one_label(values: Sequence[str] | Sequence[float], labels: Sequence[str]) -> bool:
    """Return whether several lines have each value, all with one label, and there are more values than labels.

    Labels that share texts count as one, as those of an object that is open or closed. Numbers of a label that have a
    range of their own are measured, unless each has about as many lines.
    """
    given = [pair for pair in zip(values, labels, strict=True) if pair[0] != "" and pair[0] == pair[0]]
    different = Counter(value for value, _ in given)
    if not different or _OFTEN * len(different) > len(given):
        return False
    texts = isinstance(given[0][0], str)
    if texts:
        known = groups_of_labels([value for value, _ in given], [label for _, label in given])
        given = [(value, group) for (value, _), group in zip(given, known, strict=True)]
    among = len({label for _, label in given})
    if not among < len(different) == len(set(given)):
        return False
    ranges = sum(1 for _ in groupby(sorted(given), key=itemgetter(1)))
    return texts or ranges > among or are_even([*different.values()])


def is_clock(values: Numbers, labels: Sequence[str]) -> bool:
    """Return whether steps of values are alike, or fairly alike and no larger from label to label than within one.

    Two classes of measured values that do not overlap seldom lie so closely.
    """
    rising = np.argsort(values)[: len(values) - int(np.isnan(values).sum())]
    even, own = evenness(values[rising]), np.array(labels)[rising]
    ends, steps = own[1:] != own[:-1], np.diff(values[rising])
    apart = len(rising) >= _ENOUGH_LINES and int(ends.sum()) == len(set(labels)) - 1 > 0
    touching = apart and bool((steps[ends] <= _USUAL * np.median(steps)).all())
    return even > SURE or (touching and even > FAIRLY)


def follows_from(values: Numbers, target: Numbers) -> bool:
    """Return whether these are the numbers of the target with another factor and zero, as rounding allows.

    Or whether each number of the target has one of them, of which there are not few: they rise or fall with it, or most
    numbers have several lines.
    """
    known = ~np.isnan(values)
    if known.sum() < 2 * LEAST_LINES or np.ptp(values[known]) == 0.0 or np.ptp(target[known]) == 0.0:
        return False
    values, target = (numbers[known] / np.ptp(numbers[known]) for numbers in (values, target))
    if abs(np.corrcoef(values, target)[0, 1]) >= _PROPORTIONAL:
        return True
    of_target, pairs = len(set(target.tolist())), len(set(zip(values.tolist(), target.tolist(), strict=True)))
    steps = np.diff(values[np.argsort(target, kind="stable")])
    rises = (steps >= 0.0).all() or (steps <= 0.0).all() or 2 * of_target <= len(target)
    return pairs == of_target and bool(rises) and len(set(values.tolist())) >= LEAST_LINES


def _mixed(numbers: dict[str, Numbers]) -> Iterator[str]:
    """Yield notes on columns in which a number stands for something else, or whose unit changes."""
    stand_ins: dict[float, list[str]] = {}
    for name, values in numbers.items():
        known = values[~np.isnan(values)]
        stand_in = stand_in_of(known)
        if stand_in is not None:
            stand_ins.setdefault(stand_in, []).append(name)
        elif unit_changes(known):
            yield (
                f"{name} has two groups of values, one a thousand times the other: make sure that all have one unit"
            )
    for stand_in, names in stand_ins.items():
        times = int(np.any([numbers[name] == stand_in for name in names], axis=0).sum())
        yield (
            f"{listed(names)} {'is' if len(names) == 1 else 'are'} {stand_in:g} in {counted(times, 'trial')}, unlike "
            "all other values: if it stands for a missing value, or a sensor had stopped or was at the end of its "
            "range, leave the cell empty"
        )


def _pads_apart(numbers: dict[str, Numbers]) -> Iterator[str]:
    """Yield notes on columns of two pads that agree within a factor in most trials, and are far apart in others."""
    for name, left in numbers.items():
        other = name.replace("left", "right")
        if other == name or other not in numbers:
            continue
        both, larger = left * numbers[other], np.maximum(np.abs(left), np.abs(numbers[other]))
        apart, alike = both < _APART * larger**2, both > _ALIKE * larger**2
        trials, others = int(apart.sum()), int((both >= _APART * larger**2).sum())
        if trials >= _OFTEN and others >= LEAST_LINES and int(alike.sum()) > (1.0 - _FEW) * others:
            yield (
                f"{name} and {other} are alike in {others} trials, and in {trials} one of them is less than "
                f"{100 * _APART:.0f} % of the other, or has another sign: did a fingertip fail there?"
            )


def stand_in_of(known: Numbers) -> float | None:
    """Return the value that several lines have and that is farther from all others than these are from each other.

    Or a single one that is a hundred times as far. Or the one that is repeated by far more often than any other one,
    where the others hardly repeat. A zero can be measured so often, unless no other value comes near to it.
    """
    if len(known) < 2 * LEAST_LINES:
        return None
    value, times = Counter(known.tolist()).most_common(1)[0]
    if times < _OFTEN:
        value = float(known[np.abs(known - np.median(known)).argmax()])
    others = known[known != value]
    repeats = np.unique(others, return_counts=True)[1]
    if len(repeats) < LEAST_LINES:
        return None
    span = float(others.max() - others.min()) * (1.0 if times >= _OFTEN else _LONE)
    far = value < others.min() - span or value > others.max() + span
    apart = value != 0.0 or float(np.abs(others).min()) > _FROM_ZERO * float(np.ptp(others))
    often = times >= (LEAST_LINES if value else _OFTEN)
    different = int(repeats.max()) <= 2 and len(repeats) > (1.0 - _FEW) * len(others)
    stuck = often and apart and different
    return float(value) if far or stuck else None


def unit_changes(known: Numbers) -> bool:
    """Return whether positive values have two groups that lie within each other if one is taken a thousand times."""
    if len(known) < 2 * LEAST_LINES or known.min() <= 0.0:
        return False
    rising = np.sort(known)
    ratios = rising[1:] / rising[:-1]
    k = int(ratios.argmax()) + 1
    small, large = rising[:k] * _THOUSAND, rising[k:]
    return bool(
        ratios[k - 1] > _GAP
        and min(len(small), len(large)) >= LEAST_LINES
        and large[0] <= np.median(small) <= large[-1]
        and small[0] <= np.median(large) <= small[-1]
    )
