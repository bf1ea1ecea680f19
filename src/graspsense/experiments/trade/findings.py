"""What came of a trade: rates against costs, the Pareto front, and one sentence of advice that follows from them."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping, Sequence
from importlib.resources import files
from typing import Any, Final

from attrs import frozen

from graspsense.experiments.findings import Findings, FoundTable, percent, span
from graspsense.experiments.summary import Arm, Summary
from graspsense.experiments.trade.compare import WITHOUT
from graspsense.experiments.trade.front import front
from graspsense.experiments.trade.paired import corrected_t, mcnemar
from graspsense.report.html import figure
from graspsense.report.svg import DASHES, INKS, QUIET, Picture, Scale, reaching

NOTES: Final = {
    "trade_noise": "Noise: beyond about 25 counts a cell at the edge passes the threshold of a side impact (100 "
    "counts) by noise alone, and the controller ends the grasp: that is the fall, not the features' noise.",
    "trade_next": "The next squeeze: the width alone makes hardly any answer sure, so that one squeeze is nearly "
    "always needed; a further one costs a second for opening and closing and tells little that is new of the same "
    "thing in the same place, whose stiffness blurs all of its squeezes alike.",
    "trade_time": "Seconds of a grasp: of the six features only p_first is known before the fingers rest, so the rate "
    "rises as more of the grasps have come to rest.",
}
"""What a table alone does not say."""
TOLD: Final = {
    "class": "the container",
    "state": "its state, the container being known",
    "both": "both at once",
}


@frozen(kw_only=True)
class Point:
    """One case of a trade, for one target."""

    name: str
    arm: Arm
    cost: float
    on_front: bool


def findings(summary: Summary) -> Findings:
    """Return what came out of each trade that the experiment holds."""
    tables: list[FoundTable] = []
    advice: list[str] = []
    drawn: dict[str, str] = {}
    values: dict[str, Any] = {}
    parts = {one.part or summary.planned.name: one for one in summary.planned.cases}
    titles = {part.name: part.experiment.title for part in summary.planned.parts}
    for part, case in parts.items():
        title = titles.get(part, summary.planned.experiment.title)
        arms = [arm for arm in summary.arms if (arm.case.part or summary.planned.name) == part]
        if not arms:
            continue
        if case.kind == "compare":
            told, more = _compared(part, title, arms)
            tables += more
        elif case.kind == "next_squeeze":
            told, table = _next(part, title, arms, float(case.judge.fixed_n))
            tables.append(table)
        else:
            told, table, picture = _trade(part, title, arms, case.judge)
            tables.append(table)
            if part == "trade_force":
                tables.append(_damage())
            drawn[part] = picture
        advice.append(told)
        values[part] = {"advice": told}
    notes = tuple(note for part, note in NOTES.items() if part in parts)
    answer = (
        advice[0] if len(advice) == 1 else "What follows from the numbers, trade by trade, stands with each."
    )
    if len(advice) > 1:
        rows = tuple((titles.get(part, part), values[part]["advice"]) for part in values)
        tables.insert(0, FoundTable(id="advice", title="What follows", header=("trade", "advice"), rows=rows))
    return Findings(answer=answer, tables=tuple(tables), notes=notes, drawn=drawn, values=values)


def points(arms: Sequence[Arm], cheap_is_low: bool) -> list[Point]:
    """Return the cases of one target, cheapest first, with which lie on the front."""
    costs = [cost_of(arm) for arm in arms]
    on = front(costs, [arm.rate.mean for arm in arms], cheap_is_low=cheap_is_low)
    found = [
        Point(name=_short(arm), arm=arm, cost=cost, on_front=one)
        for arm, cost, one in zip(arms, costs, on, strict=True)
    ]
    return sorted(found, key=lambda one: one.cost if cheap_is_low else -one.cost)


def cost_of(arm: Arm) -> float:
    """Return the mean cost of an arm over its seeds."""
    costs = [float(one.get("cost", math.nan)) for one in arm.judged.values()]
    return math.fsum(costs) / len(costs)


ENOUGH: Final = 0.05
"""A case is enough where it loses less than this against the best, at 95 %."""


def advise(found: Sequence[Point], axis: str) -> str:
    """Return the cheapest case that is enough, in a sentence that follows from the numbers alone."""
    best = max(found, key=lambda one: one.arm.rate.mean)
    told = TOLD[best.arm.target]
    at_best = f"{best.name} ({_rate(best.arm)}) at {best.cost:.3g}"
    if best.arm.less(best.arm) is None:
        return f"For {told}, {at_best} {axis} is best, of one seed: that says nothing of differences."
    for one in found:
        gap = best.arm.less(one.arm)
        if one is best:
            break
        if gap is not None and gap[1][1] < ENOUGH:
            return (
                f"For {told}, take {one.name} ({_rate(one.arm)}) at {one.cost:.3g} {axis}: against the best, "
                f"{at_best}, it loses {100 * gap[0]:.1f} points ({100 * gap[1][0]:.1f} to {100 * gap[1][1]:.1f}), "
                "less than 5."
            )
    return (
        f"For {told}, take {at_best} {axis}: it is the best, and of everything cheaper it cannot be said that it loses "
        "less than 5 points."
    )


def _rate(arm: Arm) -> str:
    return f"{percent(arm.rate.mean)}, {span(arm.rate.interval)}"


def _short(arm: Arm) -> str:
    """Return what tells an arm from the others of its part."""
    case = arm.case.name.removeprefix(arm.case.part).removeprefix(": ")
    return ", ".join(part for part in (case, "" if case and arm.learner == "c45" else arm.learner) if part)


LEFT: Final = 40.0


def _picture(found: Mapping[str, Sequence[Point]], axis: str, title: str) -> str:
    """Return the rates against their costs, a line a target through its front; what is off the front is small."""
    every = [one for points_ in found.values() for one in points_]
    picture = Picture(262 + 15 * (len(found) + 1))
    x = reaching([one.cost for one in every], LEFT, picture.width - 14)
    y = Scale(0.0, 100.0, 215, 24)
    picture.y_axis(y, LEFT - 4, picture.width - 8, "recognised, in %")
    picture.x_axis(x, 24, 215, axis)
    told = []
    for k, (target, points_) in enumerate(found.items()):
        ink = INKS[k % len(INKS)]
        on = sorted((one for one in points_ if one.on_front), key=lambda one: one.cost)
        picture.line(
            [(x(one.cost), y(100 * one.arm.rate.mean)) for one in on], ink, dash=DASHES[k % len(DASHES)]
        )
        for one in points_:
            at = x(one.cost)
            low, high = (y(100 * end) for end in one.arm.rate.interval)
            picture.line([(at, low), (at, high)], ink, width=1.2)
            picture.mark(at, y(100 * one.arm.rate.mean), ink, k, 4.0 if one.on_front else 1.8)
        row = 262.0 + 15 * k
        picture.mark(53, row - 4, ink, k)
        picture.text(62, row, target)
        told.append(f"{target}: " + ", ".join(f"{one.name} {_rate(one.arm)}" for one in points_))
    picture.text(LEFT, 262.0 + 15 * len(found), "large and joined: on the front; small: off it", ink=QUIET)
    caption = f"{title}. Bars are 95 % intervals of the mean."
    return figure(picture.svg(f"Recognition rate against {axis}. {'; '.join(told)}"), caption)


def _trade(part: str, title: str, arms: Sequence[Arm], judge: Any) -> tuple[str, FoundTable, str]:
    low = judge.cheap == "low"
    rows: list[tuple[str, ...]] = []
    told: list[str] = []
    series: dict[str, Sequence[Point]] = {}
    for target in dict.fromkeys(arm.target for arm in arms):
        found = points([arm for arm in arms if arm.target == target], low)
        told.append(advise(found, judge.axis))
        for one in found:
            rows.append(
                (
                    one.name,
                    TOLD[target],
                    f"{one.cost:.3g}",
                    percent(one.arm.rate.mean),
                    span(one.arm.rate.interval),
                    "yes" if one.on_front else "",
                )
            )
        series[TOLD[target]] = found
    picture = _picture(series, judge.axis, title)
    table = FoundTable(
        id=part,
        title=title,
        header=("case", "told", judge.axis, "recognised", "95 % of the mean", "on the front"),
        rows=tuple(rows),
        note=" ".join(told),
        numbers=2,
    )
    return " ".join(told), table, picture


def _damage() -> FoundTable:
    text = files("graspsense.experiments.trade").joinpath("damage.toml").read_text(encoding="utf-8")
    known: Mapping[str, Mapping[str, Any]] = tomllib.loads(text)
    return FoundTable(
        id="damage",
        title="From which force on a container starts to be damaged",
        header=("container", "force on a pad, N", "probing force, N", "why"),
        rows=tuple(
            (name, f"{one['force_n']:g}", f"{1.5 * one['force_n'] + 7:.0f}", str(one["reason"]))
            for name, one in known.items()
        ),
        note="Assumptions, none measured. A probing force is an effort; the default gripper's friction takes 7 N of it "
        "and half of what lands on the pads.",
        numbers=1,
    )


def _next(part: str, title: str, arms: Sequence[Arm], fixed_n: float) -> tuple[str, FoundTable]:
    fixed = next(arm for arm in arms if arm.learner == f"one squeeze of {fixed_n:g} N")
    found = points(arms, True)
    seconds = cost_of(fixed)
    rows, faster = [], []
    for one in found:
        gap = None if one.arm is fixed else one.arm.less(fixed)
        saved = None if one.arm is fixed else _saved(one.arm, fixed)
        rows.append(
            (
                one.name,
                f"{one.cost:.2f}",
                f"{_mean(one.arm, 'squeezes'):.2f}",
                percent(one.arm.rate.mean),
                span(one.arm.rate.interval),
                ""
                if gap is None
                else f"{100 * gap[0]:+.1f} ({100 * gap[1][0]:+.1f} to {100 * gap[1][1]:+.1f})",
                "" if saved is None else f"{saved[0]:+.2f} ({saved[1][0]:+.2f} to {saved[1][1]:+.2f})",
                "yes" if one.on_front else "",
            )
        )
        if (
            one.name.startswith("sequential")
            and gap is not None
            and saved is not None
            and gap[0] >= 0.0
            and saved[1][1] < 0.0
        ):
            faster.append((one, saved))
    if faster:
        one, saved = min(faster, key=lambda pair: pair[1][0])
        told = (
            f"Choosing the next squeeze reaches the rate of one {fixed_n:g} N squeeze in less time: {one.name} is "
            f"right in {_rate(one.arm)} after {one.cost:.2f} s from the contact on, the fixed squeeze in "
            f"{_rate(fixed)} after {seconds:.2f} s: {-saved[0]:.2f} s less "
            f"(95 % {-saved[1][1]:.2f} to {-saved[1][0]:.2f})."
        )
    else:
        told = (
            f"Choosing the next squeeze does not reach the rate of one {fixed_n:g} N squeeze ({_rate(fixed)}) in less "
            f"time than its {seconds:.2f} s from the contact on: no threshold does."
        )
    header = (
        "case",
        "seconds from the contact on",
        "squeezes",
        "recognised",
        "95 % of the mean",
        f"points less {fixed_n:g} N",
        f"seconds less {fixed_n:g} N",
        "on the front",
    )
    return told, FoundTable(id=part, title=title, header=header, rows=tuple(rows), note=told, numbers=1)


def _mean(arm: Arm, key: str) -> float:
    return math.fsum(float(one[key]) for one in arm.judged.values()) / len(arm.judged)


def _saved(arm: Arm, other: Arm) -> tuple[float, tuple[float, float]] | None:
    """Return the seconds of one arm less another's, seed by seed, with a 95 % interval by Student's t."""
    from scipy.special import stdtrit

    each = [
        float(arm.judged[seed]["cost"]) - float(other.judged[seed]["cost"])
        for seed in arm.judged
        if seed in other.judged
    ]
    if len(each) < 2:
        return None
    mean = math.fsum(each) / len(each)
    variance = math.fsum((one - mean) ** 2 for one in each) / (len(each) - 1)
    half = float(stdtrit(len(each) - 1, 0.975)) * math.sqrt(variance / len(each))
    return mean, (mean - half, mean + half)


def _compared(part: str, title: str, arms: Sequence[Arm]) -> tuple[str, list[FoundTable]]:
    base = arms[0]
    rows: dict[bool, list[tuple[str, ...]]] = {True: [], False: []}
    better, needed = [], []
    for arm in arms:
        gap = None if arm is base else arm.less(base)
        tested = "" if arm is base else _tested(arm, base)
        without = arm.learner.startswith(WITHOUT)
        rows[without].append(
            (
                arm.learner,
                percent(arm.rate.mean),
                span(arm.rate.interval),
                ""
                if gap is None
                else f"{100 * gap[0]:+.1f} ({100 * gap[1][0]:+.1f} to {100 * gap[1][1]:+.1f})",
                tested,
            )
        )
        if gap is not None and gap[1][0] > 0.0 and not without:
            better.append(f"{arm.learner} ({100 * gap[0]:+.1f} points)")
        if gap is not None and gap[1][1] < 0.0 and without:
            needed.append(f"{arm.learner.removeprefix(WITHOUT)} ({100 * gap[0]:+.1f} points without it)")
    found_better = f"{', '.join(better)} better" if better else "no classifier is measurably better"
    found_needed = ", ".join(needed) if needed else "none"
    told = (
        f"On the same folds, beside {base.learner} ({_rate(base)}): {found_better}. Features that are missed when "
        f"they are left out: {found_needed}."
    )
    header = ("", "recognised", "95 % of the mean", f"points less {base.learner}", "paired tests")
    found = [
        FoundTable(
            id=part,
            title=title,
            header=header,
            rows=tuple(rows[False]),
            note=told
            + " McNemar's test is exact, over the trials of all seeds: only this one right, only the other. "
            "The t-test is the corrected resampled one, over the folds of all seeds.",
            numbers=1,
        )
    ]
    if rows[True]:
        found.append(
            FoundTable(
                id=f"{part}_features",
                title="What each feature is worth",
                header=header,
                rows=tuple(rows[True]),
                numbers=1,
            )
        )
    return told, found


def _tested(arm: Arm, base: Arm) -> str:
    first: list[int] = []
    second: list[int] = []
    by_fold: list[float] = []
    n = folds = 1
    for seed in arm.judged:
        if seed not in base.judged:
            continue
        one, other = arm.judged[seed]["right"], base.judged[seed]["right"]
        first += one
        second += other
        of = arm.judged[seed].get("fold")
        if of is not None:
            n, folds = len(of), max(of) + 1
            for fold in range(folds):
                rows = [i for i, k in enumerate(of) if k == fold]
                by_fold.append(sum(one[i] - other[i] for i in rows) / len(rows))
    test = mcnemar(first, second)
    words = f"McNemar {test.only_first}:{test.only_second}, p = {test.p:.2g}"
    if len(by_fold) > 1:
        words += f"; t-test p = {corrected_t(by_fold, n / folds, n - n / folds):.2g}"
    return words
