"""The findings of trade-off experiments: rates against costs, the Pareto front, and a recommendation."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

from attrs import frozen

from graspsense.evaluation.intervals import percent, span
from graspsense.experiments.findings import CONTROLS, Findings, control_cells
from graspsense.experiments.summary import ConditionResult, Summary
from graspsense.experiments.trade.trade_point import Advice, TradePoint, advise, trade_points
from graspsense.report.found_table import FoundTable
from graspsense.report.rates import RateRow, rates_over
from graspsense.report.wording import TARGETS

RULE: Final = (
    "Recommended is the cheapest case that comes within 5 points of the best and is not shown to be worse, at 95 %, "
    "corrected for the number of cases. Where no difference is shown, that is said, and the cheapest is taken."
)
"""The rule of all recommendations."""
ONE_PROTOCOL: Final = (
    "Each container is used in all of its states; the paper does not tell whether its bottles were."
)


def findings(summary: Summary) -> Findings:
    """Return the findings of each trade-off in the experiment."""
    parts = {case.part or summary.planned.name: case for case in summary.planned.cases}
    titles = {part.name: part.experiment.title for part in summary.planned.parts}
    reports: dict[str, _Report] = {}
    for part, case in parts.items():
        title = titles.get(part, summary.planned.experiment.title)
        conditions = [
            condition
            for condition in summary.conditions
            if (condition.case.part or summary.planned.name) == part
        ]
        if not conditions:
            continue
        reports[part] = _cost_report(part, title, conditions, case.judge)
    tables = [report.table for report in reports.values()]
    tables += _controls_table(summary, titles)
    notes = [ONE_PROTOCOL]
    if "trade_force" in reports:
        table, reasons = _damage_table()
        tables.append(table)
        notes += reasons
    advice = [piece for report in reports.values() for piece in report.advice]
    if len(reports) > 1:
        tables.insert(0, _advice_table(advice))
    values: dict[str, Any] = {part: {"advice": report.text} for part, report in reports.items()}
    return Findings(
        answer=_answer(reports),
        headline=_headline(advice) if len(reports) == 1 else "",
        tables=tuple(tables),
        notes=tuple(notes),
        drawn={part: report.picture for part, report in reports.items()},
        values=values,
    )


def _controls_table(summary: Summary, titles: Mapping[str, str]) -> list[FoundTable]:
    """Return the table of the controls of every case that has them; none if none was measured."""
    lines = []
    for condition in summary.conditions:
        if not condition.controls:
            continue
        part = condition.case.part or summary.planned.name
        title = titles.get(part, summary.planned.experiment.title)
        case = condition.case.name.removeprefix(condition.case.part).removeprefix(": ")
        what = (title, case, TARGETS[condition.target])
        lines.append((*what, percent(condition.rate.mean), *control_cells(condition)))
    if not lines:
        return []
    table = FoundTable(
        id="controls",
        title="Controls",
        header=("trade-off", "case", "recognises", "recognised", *CONTROLS.values()),
        rows=tuple(lines),
        note="Means over the seeds. Before contact and with shuffled labels, the rate should not be above that of the "
        "most frequent label. The width is known at the contact, before anything is paid for. The last column holds "
        "out whole bottles. There is no control by the order of recording, because simulated trials have none.",
        numbers=3,
    )
    return [table]


def _answer(reports: dict[str, _Report]) -> str:
    if not reports:
        return "There is no answer yet: no task has a result."
    if len(reports) == 1:
        return next(iter(reports.values())).text
    return (
        f"{len(reports)} trade-offs were measured. Each has its recommendation below, or says that there is none. "
        "Rates of different trade-offs cannot be compared: they differ in what is recognised (the object, its state, "
        "or both), in the trials and bottles, in the folds and in the seeds."
    )


def _headline(advice: Sequence[Advice]) -> str:
    """Return the recommendations as a person would say them."""
    text = "; ".join(f"to recognise {piece.recognises}, {_in_short(piece)}" for piece in advice)
    return text[:1].upper() + text[1:]


def _in_short(piece: Advice) -> str:
    """Return the recommendation; what the seeds do not show is not said."""
    if piece.recommended is None:
        return "it cannot be told which case to take"
    name = piece.recommended.name
    if piece.best_is_cheapest:
        return f"no difference is shown; take the cheapest, {name}"
    if piece.recommended is piece.best:
        return f"{name} {'is best' if piece.shown else 'has the highest rate'}"
    if piece.loss is None or piece.shown:
        return f"{name} is enough"
    return f"no difference is shown; the cheapest, {name}, loses at most {100 * piece.loss.interval[1]:.1f} points"


def _advice_table(advice: Sequence[Advice]) -> FoundTable:
    return FoundTable(
        id="advice",
        title="Recommendations",
        header=(
            "trade-off",
            "recognises",
            "recommended",
            "cost",
            "recognised",
            "best",
            "points below the best",
        ),
        rows=tuple(piece.cells for piece in advice),
        note=RULE,
        numbers=4,
    )


@frozen(kw_only=True)
class _Report:
    """The findings of one part of an experiment."""

    table: FoundTable
    picture: str
    advice: tuple[Advice, ...]

    @property
    def text(self) -> str:
        """The recommendations in a few sentences."""
        return " ".join(piece.text for piece in self.advice)


def _cost_report(part: str, title: str, conditions: Sequence[ConditionResult], cost: Any) -> _Report:
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
    table = FoundTable(
        id=part,
        title=title,
        header=("case", "recognises", cost.axis, "recognised", "95 % of the mean", "on the Pareto front"),
        rows=tuple(rows),
        note=" ".join(piece.text for piece in advice),
        numbers=2,
    )
    caption = (
        f"{title}. Bars are 95 % intervals of the mean. Large marks, which are joined, may be on the Pareto front; "
        "small ones are not."
    )
    return _Report(table=table, picture=rates_over(series, cost.axis, caption), advice=tuple(advice))


def _damage_table() -> tuple[FoundTable, list[str]]:
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
