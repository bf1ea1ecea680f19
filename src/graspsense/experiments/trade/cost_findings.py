"""The findings of one trade-off: a table, a picture and a recommendation."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

from attrs import frozen

from graspsense.evaluation.intervals import percent, span
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.trade_point import Advice, TradePoint, advise, trade_points
from graspsense.report.found_table import FoundTable
from graspsense.report.html import figure
from graspsense.report.rates import RateRow, draw_breaks, rate_axis_title, rate_scale
from graspsense.report.svg import DASHES, INKS, QUIET, Picture, reaching
from graspsense.report.wording import TARGETS

LEFT: Final = 40.0


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
    series: dict[str, Sequence[TradePoint]] = {}
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
        series[TARGETS[target]] = points
    text = " ".join(sentence.text for sentence in advice)
    table = FoundTable(
        id=part,
        title=title,
        header=("case", "recognises", cost.axis, "recognised", "95 % of the mean", "on the Pareto front"),
        rows=tuple(rows),
        note=text,
        numbers=2,
    )
    return Report(text=text, table=table, picture=_picture(series, cost.axis, title), advice=tuple(advice))


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


def _picture(series: Mapping[str, Sequence[TradePoint]], axis: str, title: str) -> str:
    """Return the rates against their costs, with a line through the Pareto front of each target."""
    every = [point for points in series.values() for point in points]
    picture = Picture(262 + 15 * (len(series) + 1))
    x = reaching([point.cost for point in every], LEFT, picture.width - 14)
    y = rate_scale([_row(point) for point in every], 215, 24)
    picture.y_axis(y, LEFT - 4, picture.width - 8, rate_axis_title(y))
    draw_breaks(picture, y, LEFT - 4, 0.0, upright=True)
    picture.x_axis(x, 24, 215, axis)
    words = []
    for k, (target, points) in enumerate(series.items()):
        ink = INKS[k % len(INKS)]
        on_front = sorted((point for point in points if point.on_front != "no"), key=lambda point: point.cost)
        # Each target is shifted, so that equal rates at the same cost do not hide each other.
        shift = 5.0 * (k - (len(series) - 1) / 2)
        line = [(x(point.cost) + shift, y(100 * point.condition.rate.mean)) for point in on_front]
        with picture.plot(x, y, 24, 215):
            picture.line(line, ink, dash=DASHES[k % len(DASHES)])
            for point in points:
                place = x(point.cost) + shift
                interval = point.condition.rate.interval
                if interval is not None:
                    low, high = (y(100 * rate) for rate in interval)
                    picture.line([(place, low), (place, high)], ink, width=1.2)
                size = 4.0 if point.on_front != "no" else 1.8
                read_out = f"{point.name}, {target}: {point.rate_text}"
                picture.mark(place, y(100 * point.condition.rate.mean), ink, k, size, read_out)
        legend = 262.0 + 15 * k
        picture.mark(53, legend - 4, ink, k)
        picture.text(62, legend, target)
        words.append(f"{target}: " + ", ".join(f"{point.name} {point.rate_text}" for point in points))
    picture.text(
        LEFT,
        262.0 + 15 * len(series),
        "large, joined: may be on the Pareto front; small: not on it",
        ink=QUIET,
    )
    caption = f"{title}. Bars are 95 % intervals of the mean."
    return figure(picture.svg(f"Recognition rate against {axis}. {'; '.join(words)}"), caption)


def _row(point: TradePoint) -> RateRow:
    rate = point.condition.rate
    return RateRow(name=point.name, rate=rate.mean, interval=rate.interval)
