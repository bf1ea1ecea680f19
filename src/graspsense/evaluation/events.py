"""How well a detector tells the events that others labelled: precision, recall and delay, with whole groups held out.

An event is found by the first detection that is at most the tolerance from its beginning; each detection finds one
event at most. Another detection while an event goes on is neither right nor wrong, and every other one is a false
alarm. Nothing counts where the labels are missing, or as near to that as the tolerance. Thresholds are fitted by one
factor for all of them, that with the best F1 on the recordings of the other groups. As a control, the same detections
are moved by half of the length of their recording: what remains of their rates is chance.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final

import numpy as np
from attrs import field, frozen

from graspsense.core.values.signals import NOT_KNOWN
from graspsense.evaluation.folds import instance_held_out
from graspsense.evaluation.intervals import MIN_INSTANCES, Interval, RecognitionRate, rate_of, too_few

Spans = Sequence[tuple[float, float]]
Told = Mapping[str, Sequence[float]]
"""The times (s) at which a detector tells each of its events."""
RESAMPLES: Final = 2000
STEPS: Final = tuple(10.0 ** (k / 4) for k in range(-8, 9))
"""The factors that are tried, of the one that fits the unit."""


@frozen(kw_only=True, eq=False)
class LabelledEvents:
    """The labelled events of a recording by their names, its first and last time (s), and the group it belongs to."""

    labelled: Mapping[str, Spans]
    begin_s: float
    end_s: float
    group: str

    @property
    def seconds(self) -> float:
        """The length of the recording."""
        return self.end_s - self.begin_s

    def outcomes(self, name: str, told: Sequence[float], tolerance_s: float) -> Outcomes:
        """Return what became of the labels of this name and of detections."""
        return outcomes(self.labelled[name], self.labelled.get(name + NOT_KNOWN, ()), told, tolerance_s)

    def moved(self, told: Sequence[float]) -> list[float]:
        """Return detections moved by half of the recording; what leaves it at the end comes in at the beginning."""
        if not self.seconds:
            return list(told)
        return [self.begin_s + (value - self.begin_s + 0.5 * self.seconds) % self.seconds for value in told]


@frozen(kw_only=True)
class Outcomes:
    """What became of the labels and detections of a recording: delays of those found, numbers of the others."""

    delays_s: tuple[float, ...] = ()
    missed: int = 0
    false_alarms: int = 0
    repeated: int = 0


@frozen(kw_only=True)
class DetectionDelay:
    """The median delay (s) of the events that were found, 10 and 90 % quantiles, and the interval of the median."""

    median_s: float
    low_s: float
    high_s: float
    interval: Interval | None
    no_interval: str = ""


@frozen(kw_only=True)
class EventScore:
    """How well one kind of event is told. A rate is None where nothing was labelled, or nothing told."""

    labelled: int
    detected: int = field(alias="found")
    false_alarms: int
    repeated: int
    seconds: float
    recall: RecognitionRate | None
    precision: RecognitionRate | None
    delay: DetectionDelay | None


@frozen(kw_only=True)
class KindOfEvent:
    """The scores of one kind of event: by the thresholds as they are, and by fitted ones on groups held out.

    `factors` are those of the thresholds that were fitted, one for each fold. `chance` is the control, and `by_group`
    has the numbers found, labelled and of false alarms of each group. Both are of the fitted thresholds if there are
    any.
    """

    given: EventScore
    fitted: EventScore | None
    chance: EventScore
    not_fitted: str = ""
    factors: tuple[float, ...] = ()
    by_group: Mapping[str, tuple[int, int, int]] = field(factory=dict)


@frozen(kw_only=True)
class EventsEvaluation:
    """What a detector tells of labelled events. `not_told` are labelled names that it does not know."""

    source: str
    detector: str
    tolerance_s: float
    recordings: int
    held_out: str
    kinds: Mapping[str, KindOfEvent]
    not_told: tuple[str, ...]
    not_labelled: Mapping[str, int]
    notes: tuple[str, ...]


def outcomes(labels: Spans, unknown: Spans, told: Sequence[float], tolerance_s: float) -> Outcomes:
    """Return what became of the labels (begin and end, s) and the detections (s) of one recording."""
    free, delays = sorted(told), []
    for begin, _ in sorted(labels):
        near = next((t_s for t_s in free if abs(t_s - begin) <= tolerance_s), None)
        if near is not None:
            free.remove(near)
            delays.append(near - begin)
    free = [t_s for t_s in free if not any(b - tolerance_s <= t_s <= e + tolerance_s for b, e in unknown)]
    repeated = sum(any(b <= t_s <= e for b, e in labels if e > b) for t_s in free)
    return Outcomes(
        delays_s=tuple(delays),
        missed=len(labels) - len(delays),
        false_alarms=len(free) - repeated,
        repeated=repeated,
    )


def evaluate_kind(
    name: str,
    recordings: Sequence[LabelledEvents],
    told: Callable[[int, float], Told],
    *,
    factor: float,
    tolerance_s: float,
    folds: int,
    seed: int,
) -> KindOfEvent:
    """Return the scores of one kind of event in the recordings in which it is labelled.

    `told` gives the detections in the recording of this number with thresholds times a factor; `factor` is what the
    thresholds have to be multiplied by for the unit of the forces.
    """
    rows = [(k, recording) for k, recording in enumerate(recordings) if name in recording.labelled]
    groups = [recording.group for _, recording in rows]

    def scores(factors: Sequence[float]) -> tuple[EventScore, EventScore, dict[str, tuple[int, int, int]]]:
        """Return the score with these factors, one for each row, that of chance, and the numbers of each group."""
        results, moved = [], []
        for (k, recording), by in zip(rows, factors, strict=True):
            t_s = told(k, by).get(name, ())
            results.append(recording.outcomes(name, t_s, tolerance_s))
            moved.append(recording.outcomes(name, recording.moved(t_s), tolerance_s))
        seconds = math.fsum(recording.seconds for _, recording in rows)
        return (
            _score(results, groups, seconds, seed),
            _score(moved, groups, seconds, seed),
            _by_group(results, groups),
        )

    given, chance, by_group = scores([1.0] * len(rows))
    why = "" if given.labelled else "none is labelled"
    if len(set(groups)) < 2:
        why = why or f"all recordings are of {groups[0]}, so none can be held out"
    if why:
        return KindOfEvent(given=given, fitted=None, chance=chance, not_fitted=why, by_group=by_group)
    tried = {
        step: [each.outcomes(name, told(k, factor * step).get(name, ()), tolerance_s) for k, each in rows]
        for step in STEPS
    }
    fold_of = instance_held_out(groups, groups, min(folds, len(set(groups))), seed).tolist()

    def best(fold: int) -> float:
        """Return the factor with the best F1 on the recordings of the other folds; of several, the one next to 1."""
        others = [k for k, its_fold in enumerate(fold_of) if its_fold != fold]
        return float(
            max(STEPS, key=lambda step: (_f1([tried[step][k] for k in others]), -abs(math.log(step))))
        )

    chosen = {fold: factor * best(fold) for fold in sorted(set(fold_of))}
    fitted, chance, by_group = scores([chosen[fold] for fold in fold_of])
    return KindOfEvent(
        given=given, fitted=fitted, chance=chance, factors=tuple(chosen.values()), by_group=by_group
    )


def _f1(results: Sequence[Outcomes]) -> float:
    hits = sum(len(result.delays_s) for result in results)
    wrong = sum(result.missed + result.false_alarms for result in results)
    return 2.0 * hits / (2.0 * hits + wrong) if hits else 0.0


def _score(results: Sequence[Outcomes], groups: Sequence[str], seconds: float, seed: int) -> EventScore:
    hits = [len(result.delays_s) for result in results]
    delays = [
        (delay, group) for result, group in zip(results, groups, strict=True) for delay in result.delays_s
    ]
    alarms = [result.false_alarms for result in results]
    return EventScore(
        labelled=sum(hits) + sum(result.missed for result in results),
        found=sum(hits),
        false_alarms=sum(alarms),
        repeated=sum(result.repeated for result in results),
        seconds=seconds,
        recall=_rate(hits, [result.missed for result in results], groups),
        precision=_rate(hits, alarms, groups),
        delay=_delay(delays, seed) if delays else None,
    )


def _rate(right: Sequence[int], wrong: Sequence[int], groups: Sequence[str]) -> RecognitionRate | None:
    """Return the share of right ones, with an interval over the groups."""
    each = [
        (is_right, group)
        for r, w, group in zip(right, wrong, groups, strict=True)
        for is_right in (True,) * r + (False,) * w
    ]
    return rate_of([is_right for is_right, _ in each], [group for _, group in each]) if each else None


def _delay(delays: Sequence[tuple[float, str]], seed: int) -> DetectionDelay:
    """Return median and quantiles, with the interval of the median when whole groups are drawn again."""
    values = np.array([delay for delay, _ in delays])
    low, median, high = np.quantile(values, (0.1, 0.5, 0.9)).tolist()
    names = sorted({group for _, group in delays})
    if len(names) < MIN_INSTANCES:
        return DetectionDelay(
            median_s=median, low_s=low, high_s=high, interval=None, no_interval=too_few(len(names))
        )
    parts = [np.array([delay for delay, group in delays if group == name]) for name in names]
    rng = np.random.default_rng(seed)
    drawn = rng.integers(len(parts), size=(RESAMPLES, len(parts)))
    medians = [float(np.median(np.concatenate([parts[k] for k in row]))) for row in drawn]
    below, above = np.quantile(medians, (0.025, 0.975)).tolist()
    return DetectionDelay(median_s=median, low_s=low, high_s=high, interval=(below, above))


def _by_group(results: Sequence[Outcomes], groups: Sequence[str]) -> dict[str, tuple[int, int, int]]:
    """Return the numbers of events found, labelled, and of false alarms of each group."""
    totals = dict.fromkeys(sorted(set(groups)), (0, 0, 0))
    for result, group in zip(results, groups, strict=True):
        hits, labelled, alarms = totals[group]
        n = len(result.delays_s)
        totals[group] = (hits + n, labelled + n + result.missed, alarms + result.false_alarms)
    return totals
