"""The findings of one trade-off: a table, a picture and a recommendation."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any

from attrs import frozen

from graspsense.evaluation.intervals import percent, span
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.trade_point import Advice, TradePoint, advise, trade_points
from graspsense.report.found_table import FoundTable
from graspsense.report.rates import RateRow, rates_over
from graspsense.report.wording import TARGETS


@frozen(kw_only=True)
class Report:
    """The findings of one part of an experiment; `text` sums them up in a few sentences."""

    text: str
    table: FoundTable
    picture: str
    advice: tuple[Advice, ...]


def cost_report(part: str, title: str, conditions: Sequence[ConditionResult], cost: Any) -> Report:
    """Return the rates against their cost; `cost` holds the keys of `Cost`."""
    rows: list[tuple[str, ...]] = []
    advice: list[Advice] = []
    series: dict[str, Sequence[tuple[float, RateRow]]] = {}
    for target in dict.fromkeys(condition.target for condition in conditions):
        points = trade_points(
            [result for result in conditions if result.target == target], cost.cheap == "low"
        )
        advice.append(advise(points, title, cost.axis, cost.caution))
        rows += [
            (
                point.name,
                advice[-1].recognises,
                f"{point.cost:.3g}",
                percent(point.condition.rate.mean),
                span(point.condition.rate.interval),
                point.on_front,
            )
            for point in points
        ]
        series[TARGETS[target]] = [(point.cost, _row(point)) for point in points]
    text = " ".join(sentence.text for sentence in advice)
    table = FoundTable(
        id=part,
        title=title,
        header=("case", "recognises", cost.axis, "recognised", "95 % of the mean", "on the Pareto front"),
        rows=tuple(rows),
        note=text,
        numbers=2,
    )
    caption = (
        f"{title}. Bars are 95 % intervals of the mean. Large marks, which are joined, may be on the Pareto front; "
        "small ones are not."
    )
    return Report(
        text=text, table=table, picture=rates_over(series, cost.axis, caption), advice=tuple(advice)
    )


def damage_table() -> tuple[FoundTable, list[str]]:
    """Return the forces that damage each container, and the reason for each."""
    text = files("graspsense.experiments.trade").joinpath("damage.toml").read_text(encoding="utf-8")
    known: Mapping[str, Mapping[str, Any]] = tomllib.loads(text)
    table = FoundTable(
        id="damage",
        title="Force from which a container is damaged",
        header=("container", "force on a pad, N", "probing force, N"),
        rows=tuple(
            (name, f"{row['force_n']:g}", f"{1.5 * row['force_n'] + 7:.0f}") for name, row in known.items()
        ),
        note="These are assumptions, not measurements. A probing force is an effort: the friction of the default "
        "gripper takes 7 N of it, plus half of the force on the pads.",
        numbers=1,
    )
    return table, [f"Damage, {name}: {row['reason']}" for name, row in known.items()]


def _row(point: TradePoint) -> RateRow:
    rate = point.condition.rate
    return RateRow(name=point.name, rate=rate.mean, interval=rate.interval, joined=point.on_front != "no")
