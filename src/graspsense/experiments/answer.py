"""The answer to the question of an experiment: one or two sentences, computed from the rates alone."""

from __future__ import annotations

from collections.abc import Sequence

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
    target = summary.conditions[0].target
    conditions = [condition for condition in summary.conditions if condition.target == target]
    best = max(conditions, key=lambda condition: condition.rate.mean)
    sample = _sample(best)
    recognises = TARGETS[conditions[0].recognised]
    if len(conditions) == 1:
        return f"{_capitalised(best.name)} recognises {recognises} in {_rate(best)} of {sample}."
    verdict = _verdict(conditions, best)
    if len({condition.rate.mean for condition in conditions}) == 1:
        doubt = "" if verdict == "agrees" else " Whether a case is better cannot be told."
        return f"All {len(conditions)} cases recognise {recognises} in {_rate(best)} of {sample}.{doubt}"
    told = {
        "differs": f"{_capitalised(best.name)} is better than {_worst(conditions).name}: it recognises",
        "agrees": f"All cases agree within {100 * MARGIN:g} points: {best.name} recognises",
        "cannot be told": f"Whether a case is better cannot be told. {_capitalised(best.name)} recognises",
    }[verdict]
    return f"{told} {recognises} in {_rate(best)} of {sample}. {_comparison(conditions, best)}"


def headline(summary: Summary) -> str:
    """Return the answer as a person would say it, without intervals; empty without a result."""
    if not summary.conditions:
        return ""
    target = summary.conditions[0].target
    conditions = [condition for condition in summary.conditions if condition.target == target]
    best = max(conditions, key=lambda condition: condition.rate.mean)
    worst = _worst(conditions)
    recognises = TARGETS[best.recognised]
    told = f"{recognises} recognised in {in_hundred(best.rate.mean)} grasps ({_sample(best)})"
    if len(conditions) == 1:
        return _capitalised(told)
    if _verdict(conditions, best) == "differs":
        name = _capitalised(best.name)
        return f"{name} has the highest rate: {told}, against {in_hundred(worst.rate.mean)} with {worst.name}"
    span = in_hundred(best.rate.mean)
    if f"{100 * worst.rate.mean:.0f}" != f"{100 * best.rate.mean:.0f}":
        span = f"{100 * worst.rate.mean:.0f} to {span}"
    return (
        f"No case is shown to be better than the others: {told.replace(in_hundred(best.rate.mean), span, 1)}"
    )


def _worst(conditions: Sequence[ConditionResult]) -> ConditionResult:
    return min(conditions, key=lambda condition: condition.rate.mean)


def _verdict(conditions: Sequence[ConditionResult], best: ConditionResult) -> Verdict:
    """Return whether the highest and the lowest rate differ, corrected for the number of pairs of cases.

    Two of many rates are the highest and the lowest by chance. Rates that are not paired by seed differ if their
    intervals do not overlap, and if the interval of the difference says so too.
    """
    worst = _worst(conditions)
    gap = best.minus(worst, comparisons=_pairs(conditions))
    if gap is not None:
        return verdict_on(gap.interval)
    low, high = best.rate.interval, worst.rate.interval
    if low is None or high is None or high[1] >= low[0]:
        return "cannot be told"
    unpaired = unpaired_difference(best.rate.mean, worst.rate.mean, (low, high), _pairs(conditions))
    return "differs" if unpaired.is_positive else "cannot be told"


def _pairs(conditions: Sequence[ConditionResult]) -> int:
    """Return the number of pairs of conditions, of which the highest and the lowest rate are one."""
    return len(conditions) * (len(conditions) - 1) // 2


def _comparison(conditions: Sequence[ConditionResult], best: ConditionResult) -> str:
    """Return the sentence that compares the ends of a sweep, or else the best condition with the worst."""
    ends = _ends_of_sweep(conditions)
    change = None if ends is None else ends[1].minus(ends[0])
    if ends is not None and change is not None:
        return f"From {ends[0].name} to {ends[1].name} the rate changes by {_points(change)}."
    worst = _worst(conditions)
    gap = best.minus(worst, comparisons=_pairs(conditions))
    name = _capitalised(worst.name)
    if gap is not None:
        return f"{name} has the lowest rate, {_rate(worst)}; the difference is {_points(gap)}."
    low, high = best.rate.interval, worst.rate.interval
    if low is None or high is None:
        return f"{name} has the lowest rate, {_rate(worst)}; without intervals the difference may be chance."
    if high[1] >= low[0]:
        return f"{name} has the lowest rate, {_rate(worst)}; as the intervals overlap, the difference may be chance."
    if _verdict(conditions, best) != "differs":
        return (
            f"{name} has the lowest rate, {_rate(worst)}; among {len(conditions)} cases this may be chance."
        )
    return f"{name} has the lowest rate, {_rate(worst)}."


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


def _rate(condition: ConditionResult) -> str:
    interval = condition.rate.interval
    if interval is None:
        return f"{100 * condition.rate.mean:.1f} % (no interval)"
    return f"{100 * condition.rate.mean:.1f} % (95 %: {100 * interval[0]:.1f} to {100 * interval[1]:.1f})"
