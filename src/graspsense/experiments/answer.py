"""The answer to the question of an experiment: one or two sentences, computed from the rates alone."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen

from graspsense.evaluation.intervals import unpaired_difference
from graspsense.evaluation.over_seeds import MARGIN, MeanDifference, Verdict, verdict_on
from graspsense.experiments.summary import ConditionResult, Summary
from graspsense.report.verdict import in_hundred
from graspsense.report.wording import TARGETS


def answer(summary: Summary) -> str:
    """Return the answer in one or two sentences."""
    if not summary.conditions:
        if summary.results:
            return (
                "This kind of experiment measures no rates, and names no `findings` that report its results."
            )
        return "There is no answer yet: no task has a result."
    ranked = _Ranked.from_conditions(summary.of_first_target)
    conditions, best = ranked.conditions, ranked.best
    rate = f"{TARGETS[conditions[0].recognised]} in {best.rate.words} of {_sample(best)}"
    if len(conditions) == 1:
        return f"{_capitalised(best.name)} recognises {rate}."
    if len(summary.alike) == 1 and len(summary.alike[0]) == len(summary.planned.cases):
        return f"What differs between the {len(conditions)} cases changes nothing: all recognise {rate}."
    if best.rate.mean == ranked.worst.rate.mean:
        doubt = "" if ranked.verdict == "agrees" else " Whether a case is better cannot be told."
        return f"All {len(conditions)} cases recognise {rate}.{doubt}"
    told = {
        "differs": f"{_capitalised(best.name)} is better than {ranked.worst.name}: it recognises",
        "agrees": f"All cases agree within {100 * MARGIN:g} points: {best.name} recognises",
        "cannot be told": f"Whether a case is better cannot be told. {_capitalised(best.name)} recognises",
    }[ranked.verdict]
    return f"{told} {rate}. {ranked.comparison}"


def headline(summary: Summary) -> str:
    """Return the answer as a person would say it, without intervals; empty without a result."""
    if not summary.conditions:
        return ""
    ranked = _Ranked.from_conditions(summary.of_first_target)
    best, worst = ranked.best, ranked.worst

    def told(rate: str) -> str:
        return f"{TARGETS[best.recognised]} recognised in {rate} grasps ({_sample(best)})"

    rate = in_hundred(best.rate.mean)
    if len(ranked.conditions) == 1:
        return _capitalised(told(rate))
    if ranked.verdict == "differs":
        against = f"against {in_hundred(worst.rate.mean)} with {worst.name}"
        return f"{_capitalised(best.name)} has the highest rate: {told(rate)}, {against}"
    lowest = f"{100 * worst.rate.mean:.0f}"
    span = rate if rate.startswith(f"{lowest} ") else f"{lowest} to {rate}"
    return f"No case is shown to be better than the others: {told(span)}"


@frozen
class _Ranked:
    """The conditions of one target, those with the highest and the lowest rate, and what is shown of these two.

    The verdict is corrected for the number of pairs: two of many rates are the highest and the lowest by chance. `gap`
    is None if the rates are not paired by seed. Such rates differ if their intervals do not overlap, and if the
    interval of the difference says so too.
    """

    conditions: Sequence[ConditionResult]
    best: ConditionResult
    worst: ConditionResult
    gap: MeanDifference | None
    verdict: Verdict

    @classmethod
    def from_conditions(cls, conditions: Sequence[ConditionResult]) -> _Ranked:
        best = max(conditions, key=lambda condition: condition.rate.mean)
        worst = min(conditions, key=lambda condition: condition.rate.mean)
        pairs = max(len(conditions) * (len(conditions) - 1) // 2, 1)
        gap = best.minus(worst, comparisons=pairs)
        verdict: Verdict = "cannot be told"
        low, high = best.rate.interval, worst.rate.interval
        if gap is not None:
            verdict = verdict_on(gap.interval)
        elif low is not None and high is not None and high[1] < low[0]:
            unpaired = unpaired_difference(best.rate.mean, worst.rate.mean, (low, high), pairs)
            verdict = "differs" if unpaired.is_positive else "cannot be told"
        return cls(conditions, best, worst, gap, verdict)

    @property
    def comparison(self) -> str:
        """The sentence that compares the ends of a sweep, or else the best condition with the worst."""
        ends = _ends_of_sweep(self.conditions)
        change = None if ends is None else ends[1].minus(ends[0])
        if ends is not None and change is not None:
            return f"From {ends[0].name} to {ends[1].name} the rate changes by {_points(change)}."
        lowest = f"{_capitalised(self.worst.name)} has the lowest rate, {self.worst.rate.words}"
        if self.gap is not None:
            return f"{lowest}; the difference is {_points(self.gap)}."
        low, high = self.best.rate.interval, self.worst.rate.interval
        if low is None or high is None:
            return f"{lowest}; without intervals the difference may be chance."
        if high[1] >= low[0]:
            return f"{lowest}; as the intervals overlap, the difference may be chance."
        if self.verdict != "differs":
            return f"{lowest}; among {len(self.conditions)} cases this may be chance."
        return f"{lowest}."


def _sample(condition: ConditionResult) -> str:
    kind = "simulated grasps" if condition.simulated else "recorded grasps"
    seeds = len(condition.by_seed)
    return f"{condition.rate.n} {kind}" + (f" per seed, over {seeds} seeds" if seeds > 1 else "")


def _ends_of_sweep(
    conditions: Sequence[ConditionResult],
) -> tuple[ConditionResult, ConditionResult] | None:
    """Return the conditions at the smallest and the largest value, if they differ in a single number only."""
    if len({condition.classifier for condition in conditions}) > 1 or len(conditions[0].case.levels) != 1:
        return None
    key = next(iter(conditions[0].case.levels))
    if not all(type(condition.case.levels.get(key)) in (int, float) for condition in conditions):
        return None
    ordered = sorted(conditions, key=lambda condition: float(condition.case.levels[key]))
    return ordered[0], ordered[-1]


def _points(change: MeanDifference) -> str:
    value, (low, high) = change.value, change.interval
    chance = "" if low > 0 or high < 0 else ", which may be chance"
    return f"{100 * value:+.1f} points (95 %: {100 * low:+.1f} to {100 * high:+.1f}){chance}"


def _capitalised(name: str) -> str:
    """Return a name as the start of a sentence."""
    return name[:1].upper() + name[1:] if " " in name else name
