"""A case of a trade-off with its cost and rate, and the recommendation that follows from all of them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Final, Literal

from attrs import frozen

from graspsense.core.learn.labelled import class_of
from graspsense.core.values.errors import counted
from graspsense.evaluation.intervals import percent, span
from graspsense.evaluation.over_seeds import MeanDifference, verdict_on
from graspsense.experiments.summary import ConditionResult
from graspsense.report.wording import TARGETS

ENOUGH: Final = 0.05
"""A case is good enough if its rate is less than this below the best one, at 95 %."""


OnFront = Literal["yes", "no", "not decided"]


@frozen(kw_only=True)
class TradePoint:
    """One case of a trade-off, for one target.

    `on_front` is `no` if a case that is at most as costly has a higher rate, and `yes` if all of those have lower ones,
    at 95 %; otherwise it is not decided.
    """

    name: str
    condition: ConditionResult
    cost: float
    on_front: OnFront

    @property
    def rate_text(self) -> str:
        """The rate in per cent with its interval."""
        rate = self.condition.rate
        return f"{percent(rate.mean)} ({span(rate.interval)})"


@frozen(kw_only=True)
class Advice:
    """The recommended case for one target, or None if a single seed allows no comparison.

    `best` has the highest rate. `loss` is its rate minus that of the recommended case, corrected for all comparisons
    with it; None if the recommended case is the best. `shown` is whether the seeds show the loss to be small enough, or
    the best to be above all cheaper cases. `caution` is stated with every recommendation.
    """

    title: str
    axis: str
    recommended: TradePoint | None
    best: TradePoint
    loss: MeanDifference | None = None
    caution: str = ""
    shown: bool = True
    best_is_cheapest: bool = False

    @property
    def recognises(self) -> str:
        """What is recognised, in words, with the objects it is about."""
        labels = self.best.condition.of_first_seed.confusion.labels
        classes = list(dict.fromkeys(class_of(label) for label in labels))
        return f"{TARGETS[self.best.condition.target]} ({', '.join(classes)})"

    @property
    def text(self) -> str:
        """The recommendation in a sentence."""
        grasps, seeds = self.best.condition.rate.n, len(self.best.condition.by_seed)
        aim = f"To recognise {self.recognises}, from {counted(grasps, 'grasp')} of each of {counted(seeds, 'seed')}"
        best = self._named(self.best)
        caution = f"; {self.caution}" if self.caution else ""
        if self.recommended is None:
            return (
                f"{aim}, it cannot be told which case to take: {best} has the highest rate, {self.best.rate_text}, and "
                f"a single seed has no interval of a difference{caution}."
            )
        if self.loss is None and self.best_is_cheapest:
            return (
                f"{aim}, no difference is shown; take the cheapest, {best}. Its rate is {self.best.rate_text}, and no "
                f"case is shown to be better{caution}."
            )
        if self.loss is None:
            why = (
                "it is above those of all cheaper cases"
                if self.shown
                else f"no cheaper case comes within {100 * ENOUGH:g} points, although {seeds} seeds do not show that "
                "all of them are worse"
            )
            return f"{aim}, use {best}: its rate is the highest, {self.best.rate_text}, and {why}{caution}."
        value, (low, high) = self.loss.value, self.loss.interval
        chosen = self._named(self.recommended)
        if not self.shown:
            return (
                f"{aim}, no difference from the best is shown: the cheapest such case, {chosen}, loses at most "
                f"{100 * high:.1f} points. It has "
                f"{self.recommended.rate_text}, and the best, {best}, {self.best.rate_text}. The loss is "
                f"{100 * value:.1f} points ({100 * low:.1f} to {100 * high:.1f}){caution}."
            )
        return (
            f"{aim}, {chosen} is good enough: it has {self.recommended.rate_text}. The best, {best}, has "
            f"{self.best.rate_text}. The loss is {100 * value:.1f} points ({100 * low:.1f} to {100 * high:.1f}), below "
            f"the limit of {100 * ENOUGH:g}{caution}."
        )

    def _named(self, point: TradePoint) -> str:
        """Return a case with its cost, unless its name says it: `probing force 20 N`."""
        cost = f"{point.cost:.3g} {self.axis}"
        return point.name if point.name.endswith(" ".join(cost.split()[:2])) else f"{point.name} at {cost}"

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        best = percent(self.best.condition.rate.mean)
        if self.recommended is None:
            return (self.title, self.recognises, "cannot be told", "", "", best, "")
        loss = "0" if self.loss is None else f"{100 * self.loss.value:.1f}"
        if self.loss is not None and not self.shown:
            loss += f" (at most {100 * self.loss.interval[1]:.1f})"
        return (
            self.title,
            self.recognises,
            self.recommended.name
            + (", no difference shown" if self.best_is_cheapest or (self.loss and not self.shown) else "")
            + (" (see the caution)" if self.caution else ""),
            f"{self.recommended.cost:.3g} {self.axis}",
            percent(self.recommended.condition.rate.mean),
            best,
            loss,
        )


def trade_points(conditions: Sequence[ConditionResult], cheap_is_low: bool) -> list[TradePoint]:
    """Return the cases of one target, the cheapest first, and whether each is on the Pareto front."""
    sign = 1.0 if cheap_is_low else -1.0
    costs = [sign * mean_cost(condition) for condition in conditions]
    points = []
    for condition, cost in zip(conditions, costs, strict=True):
        rivals = [
            other
            for other, its in zip(conditions, costs, strict=True)
            if other is not condition and its <= cost
        ]
        points.append(
            TradePoint(
                name=_short_name(condition),
                condition=condition,
                cost=sign * cost,
                on_front=_on_front(condition, rivals),
            )
        )
    return sorted(points, key=lambda point: sign * point.cost)


def _on_front(condition: ConditionResult, rivals: Sequence[ConditionResult]) -> OnFront:
    """Compare a case with those that are at most as costly, corrected for their number."""
    gaps = [condition.minus(rival, len(rivals)) for rival in rivals]
    if any(gap is not None and gap.interval[1] < 0.0 for gap in gaps):
        return "no"
    return "yes" if all(gap is not None and gap.interval[0] > 0.0 for gap in gaps) else "not decided"


def mean_cost(condition: ConditionResult) -> float:
    """Return the mean cost over the seeds; NaN if there is none."""
    costs = [math.nan if result.cost is None else result.cost for result in condition.by_seed.values()]
    return math.fsum(costs) / len(costs)


def advise(points: Sequence[TradePoint], title: str, axis: str, caution: str = "") -> Advice:
    """Return the cheapest case that comes within `ENOUGH` of the best; `points` are ordered from the cheapest.

    Its loss is below `ENOUGH`, and it is not shown to be worse; the advice says whether the loss is shown to be so
    small, or no difference is shown. Differences are corrected for the number of cases that are compared with the best.
    """
    best = max(points, key=lambda point: point.condition.rate.mean)
    cheaper = list(itertools.takewhile(lambda point: point is not best, points))
    losses = [best.condition.minus(point.condition, max(len(points) - 1, 1)) for point in cheaper]
    for point, loss in zip(cheaper, losses, strict=True):
        if loss is not None and loss.value < ENOUGH and verdict_on(loss.interval, ENOUGH) != "differs":
            shown = loss.interval[1] < ENOUGH
            return Advice(
                title=title, axis=axis, recommended=point, best=best, loss=loss, caution=caution, shown=shown
            )
    compared = best.condition.minus(best.condition) is not None
    return Advice(
        title=title,
        axis=axis,
        recommended=best if compared else None,
        best=best,
        caution=caution,
        shown=bool(cheaper) and all(loss is not None and loss.interval[0] > 0.0 for loss in losses),
        best_is_cheapest=not cheaper,
    )


def _short_name(condition: ConditionResult) -> str:
    """Return the name of a condition within its part of the experiment."""
    case = condition.case.name.removeprefix(condition.case.part).removeprefix(": ")
    classifier = "" if case and condition.classifier == "c45" else condition.classifier
    return ", ".join(part for part in (case, classifier) if part)
