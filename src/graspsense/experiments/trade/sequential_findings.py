"""The findings on choosing the next squeeze, compared with a single squeeze of fixed force."""

from __future__ import annotations

import math
from collections.abc import Sequence
from statistics import stdev

from graspsense.evaluation.intervals import percent, span, t_quantile
from graspsense.evaluation.over_seeds import MeanDifference
from graspsense.experiments.findings import FoundTable
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.cost_findings import Report
from graspsense.experiments.trade.next_squeeze import fixed_name
from graspsense.experiments.trade.trade_point import ENOUGH, TradePoint, mean_cost, trade_points

Saved = tuple[float, tuple[float, float]]


def compare_sequential(
    part: str, title: str, conditions: Sequence[ConditionResult], fixed_n: float
) -> Report:
    """Return the comparison of every case with the single squeeze of `fixed_n`."""
    fixed = next(condition for condition in conditions if condition.classifier == fixed_name(fixed_n))
    rows, faster = [], []
    for point in trade_points(conditions, True):
        difference = saved = None
        if point.condition is not fixed:
            difference, saved = point.condition.minus(fixed), _seconds_minus(point.condition, fixed)
        rows.append(_cells(point, difference, saved))
        as_good = difference is not None and difference.interval[0] > -ENOUGH
        if point.name.startswith("sequential") and as_good and saved is not None and saved[1][1] < 0.0:
            faster.append((point, saved))
    header = (
        "case",
        "s from contact to the answer",
        "squeezes",
        "recognised",
        "95 % of the mean",
        f"points more than with {fixed_n:g} N",
        "95 % of the difference in points",
        f"s more than with {fixed_n:g} N",
        "95 % of the difference in s",
        "on the Pareto front",
    )
    text = _text(fixed, fixed_n, faster)
    table = FoundTable(id=part, title=title, header=header, rows=tuple(rows), note=text, numbers=1)
    return Report(text=text, tables=(table,))


def _text(fixed: ConditionResult, fixed_n: float, faster: Sequence[tuple[TradePoint, Saved]]) -> str:
    rate = f"{percent(fixed.rate.mean)} ({span(fixed.rate.interval)})"
    seconds = mean_cost(fixed)
    if not faster:
        return (
            f"A single squeeze of {fixed_n:g} N recognises {rate} in {seconds:.2f} s from contact. No threshold of "
            "choosing the next squeeze is shown to reach this rate in less time."
        )
    point, (value, (low, high)) = min(faster, key=lambda pair: pair[1][0])
    return (
        f"Choosing the next squeeze saves time: with {point.name}, {point.rate_text} are recognised in "
        f"{point.cost:.2f} s "
        f"from contact. A single squeeze of {fixed_n:g} N needs {seconds:.2f} s for {rate}. The saving is "
        f"{-value:.2f} s (95 %: {-high:.2f} to {-low:.2f})."
    )


def _cells(point: TradePoint, difference: MeanDifference | None, saved: Saved | None) -> tuple[str, ...]:
    squeezes = [result.squeezes or 0.0 for result in point.condition.by_seed.values()]
    return (
        point.name,
        f"{point.cost:.2f}",
        f"{math.fsum(squeezes) / len(squeezes):.2f}",
        percent(point.condition.rate.mean),
        span(point.condition.rate.interval),
        "" if difference is None else f"{100 * difference.value:+.1f}",
        "" if difference is None else " to ".join(f"{100 * x:+.1f}" for x in difference.interval),
        "" if saved is None else f"{saved[0]:+.2f}",
        "" if saved is None else " to ".join(f"{x:+.2f}" for x in saved[1]),
        point.on_front,
    )


def _seconds_minus(condition: ConditionResult, other: ConditionResult) -> Saved | None:
    """Return the seconds of one condition minus another's, paired by seed, with a 95 % interval by Student's t."""
    each = [
        (result.cost or 0.0) - (other.by_seed[seed].cost or 0.0)
        for seed, result in condition.by_seed.items()
        if seed in other.by_seed
    ]
    if len(each) < 2:
        return None
    mean = math.fsum(each) / len(each)
    half = t_quantile(len(each) - 1) * stdev(each) / math.sqrt(len(each))
    return mean, (mean - half, mean + half)
