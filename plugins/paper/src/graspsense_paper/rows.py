"""Published rates compared with ours: the difference with its interval, and whether it is one that counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from attrs import frozen

from graspsense.experiment_api import (
    ConditionResult,
    Confusion,
    OverSeeds,
    Summary,
    counted,
    percent,
    span,
    wilson,
)
from graspsense_paper.basis import Basis, basis
from graspsense_paper.cases import PROTOCOLS, Protocol, by_protocol
from graspsense_paper.published import Published, PublishedRate
from graspsense_paper.verdict import AGREES, DIFFERS, UNTOLD, Verdict, within

COUNTS: Final = 0.10
"""A difference from the paper's rate from this on counts. Its own rates are known to some ten points."""


def sample(rate: OverSeeds) -> str:
    """Return how many seeds and grasps a rate is of."""
    return f"{counted(len(rate.rates), 'seed')} of {counted(rate.n, 'grasp')}"


@frozen(kw_only=True)
class RateComparison:
    """A published rate and ours over the seeds."""

    published: PublishedRate
    ours: OverSeeds
    protocol: Protocol
    """Whether each of our bottles is used in all states or in one."""
    basis: Basis

    @property
    def difference(self) -> float:
        """Our mean minus the published rate."""
        return self.ours.mean - self.published.rate

    @property
    def interval(self) -> tuple[float, float] | None:
        """The 95 % interval of the difference (Newcombe, 1998); None if ours has none.

        The published rate is that of one run. So its error is at least that of one run of ours, and at least that of
        its counts.
        """
        own, run, printed = self.ours.interval, self.ours.prediction, self.published.interval
        if own is None or run is None:
            return None
        low, high = printed or (self.published.rate, self.published.rate)
        below = max(self.published.rate - low, self.ours.mean - run[0])
        above = max(high - self.published.rate, run[1] - self.ours.mean)
        return (
            self.difference - math.hypot(self.ours.mean - own[0], above),
            self.difference + math.hypot(own[1] - self.ours.mean, below),
        )

    @property
    def verdict(self) -> Verdict:
        """Whether the rates differ by less than counts, or differ at all, or neither is shown."""
        interval = self.interval
        if interval is None or within(interval, -COUNTS, COUNTS) == AGREES:
            return within(interval, -COUNTS, COUNTS)
        return UNTOLD if interval[0] <= 0.0 <= interval[1] else DIFFERS

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        published = self.published
        its, beyond = published.interval, self.interval
        return (
            published.where,
            published.what,
            self.basis,
            PROTOCOLS[self.protocol],
            percent(published.printed),
            f"{published.correct}/{published.n} = {percent(published.rate)}, {span(its)}"
            if its
            else "counts not given",
            percent(self.ours.mean),
            span(self.ours.interval),
            sample(self.ours),
            f"{100 * self.difference:+.1f} ({100 * beyond[0]:+.1f} to {100 * beyond[1]:+.1f})"
            if beyond
            else "none",
            self.verdict,
        )

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        published = self.published
        return {
            "id": published.id,
            "where": published.where,
            "what": published.what,
            "basis": self.basis,
            "each_bottle_in": PROTOCOLS[self.protocol],
            "printed": published.printed,
            "published": published.rate,
            "published_interval": None if published.interval is None else list(published.interval),
            "ours": self.ours.mean,
            "interval": list(self.ours.interval or ()),
            "prediction_interval": list(self.ours.prediction or ()),
            "seeds": len(self.ours.rates),
            "trials_per_seed": self.ours.n,
            "difference": self.difference,
            "difference_interval": None if self.interval is None else list(self.interval),
            "verdict": self.verdict,
            "note": published.note,
        }


HEADER = (
    "where",
    "what",
    "basis",
    "each bottle in",
    "printed",
    "printed counts, 95 %",
    "our mean",
    "95 % of the mean",
    "n",
    "ours minus printed, points, 95 %",
    "verdict",
)


def rows(summary: Summary, paper: Published) -> list[RateComparison]:
    """Return a comparison for each published rate and protocol that there are results for."""
    compared = []
    for rate in paper.rates:
        conditions = by_protocol(summary, rate.experiment, rate.target, rate.settings)
        for protocol, condition in conditions.items():
            if condition.case.data.states_per_instance != protocol:
                continue
            rates = of_class(condition, rate.of_class) if rate.of_class else condition.rate
            if rates is not None:
                compared.append(
                    RateComparison(
                        published=rate,
                        ours=rates,
                        protocol=protocol,
                        basis=basis(summary, rate.experiment, *rate.about),
                    )
                )
    return compared


def of_class(condition: ConditionResult, name: str) -> OverSeeds | None:
    """Return the rates among the trials of one class, from the confusion matrices of the seeds."""
    rates, n = [], 0
    for result in condition.by_seed.values():
        matrix = result.confusion
        chosen = [i for i, label in enumerate(matrix.labels) if label.partition(":")[0] == name]
        total = sum(sum(matrix.counts[i]) for i in chosen)
        if total:
            rates.append(sum(matrix.counts[i][i] for i in chosen) / total)
            n = total
    return OverSeeds(tuple(rates), n) if rates else None


def people_beside_robot(paper: Published, robots: Sequence[ConditionResult]) -> list[tuple[str, ...]]:
    """Return one row per state: people (Table VI), the robot of the paper (Table V), and ours at 23 N by protocol."""
    people, theirs = paper.matrix("table_6").confusion, paper.matrix("table_5").confusion
    lines: list[tuple[str, ...]] = []
    for state in people.labels:
        printed = [_counted_rate(*_row(matrix, state)) for matrix in (people, theirs)]
        ours = [with_interval(_of_state(robot, state)) for robot in robots]
        lines.append((state.replace("_", " "), *printed, *ours))
    printed = [_counted_rate(matrix.correct, matrix.n) for matrix in (people, theirs)]
    return [*lines, ("all", *printed, *(with_interval(robot.rate) for robot in robots))]


def with_interval(rate: OverSeeds) -> str:
    """Return a mean rate with its interval."""
    return f"{percent(rate.mean)} ({span(rate.interval)})"


def _counted_rate(right: int, n: int) -> str:
    return f"{right}/{n} = {percent(right / n)} ({span(wilson(right, n))})"


def _row(matrix: Confusion, state: str) -> tuple[int, int]:
    """Return how many trials of a state are recognised, and how many there are."""
    k = next(k for k, label in enumerate(matrix.labels) if label.endswith(state))
    return matrix.counts[k][k], sum(matrix.counts[k])


def _of_state(condition: ConditionResult, state: str) -> OverSeeds:
    of_seeds = [_row(result.confusion, state) for result in condition.by_seed.values()]
    return OverSeeds(tuple(right / n for right, n in of_seeds), of_seeds[-1][1])
