"""A case of a trade-off with its cost and rate, and the recommendation that follows from all of them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from attrs import frozen

from graspsense.evaluation.over_seeds import MeanDifference
from graspsense.experiments.findings import percent, span
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.front import front
from graspsense.report.wording import TARGETS

ENOUGH: Final = 0.05
"""A case is good enough if it loses less than this against the best, at 95 %."""


@frozen(kw_only=True)
class TradePoint:
    """One case of a trade-off, for one target."""

    name: str
    condition: ConditionResult
    cost: float
    on_front: bool

    @property
    def rate_text(self) -> str:
        """The rate in per cent with its interval."""
        rate = self.condition.rate
        return f"{percent(rate.mean)} ({span(rate.interval)})"


@frozen(kw_only=True)
class Advice:
    """The recommended case for one target.

    `loss` is the rate of the best case minus that of the recommended one, with its interval; None if the recommended
    case is the best. `single_seed` states that differences cannot be judged.
    """

    title: str
    axis: str
    recommended: TradePoint
    best: TradePoint
    loss: MeanDifference | None = None
    single_seed: bool = False

    @property
    def recognises(self) -> str:
        """What is recognised, in words."""
        return TARGETS[self.best.condition.target]

    @property
    def text(self) -> str:
        """The recommendation in a sentence."""
        best = f"{self.best.name} at {self.best.cost:.3g} {self.axis}"
        if self.single_seed:
            return (
                f"To recognise {self.recognises}, {best} is best, with {self.best.rate_text}. There is a single "
                "seed, so differences between cases cannot be judged."
            )
        if self.loss is None:
            return (
                f"To recognise {self.recognises}, use {best}: it has the highest rate, {self.best.rate_text}. No "
                "cheaper case is shown to be within 5 points of it."
            )
        value, (low, high) = self.loss.value, self.loss.interval
        chosen = f"{self.recommended.name} at {self.recommended.cost:.3g} {self.axis}"
        return (
            f"To recognise {self.recognises}, {chosen} is good enough: it has {self.recommended.rate_text}. The best, "
            f"{best}, has {self.best.rate_text}. The loss is {100 * value:.1f} points ({100 * low:.1f} to "
            f"{100 * high:.1f}), below the limit of 5."
        )

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        loss = "0" if self.loss is None else f"{100 * self.loss.value:.1f}"
        return (
            self.title,
            self.recognises,
            self.recommended.name,
            f"{self.recommended.cost:.3g} {self.axis}",
            percent(self.recommended.condition.rate.mean),
            percent(self.best.condition.rate.mean),
            loss,
        )


def trade_points(conditions: Sequence[ConditionResult], cheap_is_low: bool) -> list[TradePoint]:
    """Return the cases of one target, the cheapest first, and whether each is on the Pareto front."""
    costs = [mean_cost(condition) for condition in conditions]
    on_front = front(costs, [one.rate.mean for one in conditions], cheap_is_low=cheap_is_low)
    points = [
        TradePoint(name=_short_name(condition), condition=condition, cost=cost, on_front=on)
        for condition, cost, on in zip(conditions, costs, on_front, strict=True)
    ]
    return sorted(points, key=lambda point: point.cost if cheap_is_low else -point.cost)


def mean_cost(condition: ConditionResult) -> float:
    """Return the mean cost over the seeds; NaN if there is none."""
    costs = [math.nan if one.cost is None else one.cost for one in condition.by_seed.values()]
    return math.fsum(costs) / len(costs)


def advise(points: Sequence[TradePoint], title: str, axis: str) -> Advice:
    """Return the cheapest case that is good enough; `points` are ordered from the cheapest."""
    best = max(points, key=lambda point: point.condition.rate.mean)
    if best.condition.minus(best.condition) is None:
        return Advice(title=title, axis=axis, recommended=best, best=best, single_seed=True)
    for point in points:
        if point is best:
            break
        loss = best.condition.minus(point.condition)
        if loss is not None and loss.interval[1] < ENOUGH:
            return Advice(title=title, axis=axis, recommended=point, best=best, loss=loss)
    return Advice(title=title, axis=axis, recommended=best, best=best)


def _short_name(condition: ConditionResult) -> str:
    """Return the name of a condition within its part of the experiment."""
    case = condition.case.name.removeprefix(condition.case.part).removeprefix(": ")
    classifier = "" if case and condition.classifier == "c45" else condition.classifier
    return ", ".join(part for part in (case, classifier) if part)
