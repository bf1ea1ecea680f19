"""Published rates compared with ours: the difference with its interval, and whether it is one that counts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from attrs import frozen

from graspsense.experiment_api import ConditionResult, OverSeeds, Summary, counted, percent, span, wilson
from graspsense_paper.basis import Basis, basis
from graspsense_paper.cases import PROTOCOLS, Protocol, condition_result, of_protocol
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
    def n(self) -> str:
        """The number of our trials."""
        return sample(self.ours)

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
            self.n,
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
        for protocol in PROTOCOLS:
            condition = condition_result(
                of_protocol(summary, protocol), rate.experiment, rate.target, rate.settings
            )
            if condition is None or condition.case.data.states_per_instance != protocol:
                continue
            rates = of_class(condition, rate.class_) if rate.class_ else condition.rate
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
    for i, state in enumerate(people.labels):
        right, total = people.counts[i][i], sum(people.counts[i])
        k = theirs.labels.index(state)
        right2, of2 = theirs.counts[k][k], sum(theirs.counts[k])
        ours = [_of_state(robot, state) for robot in robots]
        lines.append(
            (
                state.replace("_", " "),
                f"{right}/{total} = {percent(right / total)} ({span(wilson(right, total))})",
                f"{right2}/{of2} = {percent(right2 / of2)} ({span(wilson(right2, of2))})",
                *(f"{percent(rates.mean)} ({span(rates.interval)})" for rates in ours),
            )
        )
    right, right2 = people.correct, theirs.correct
    lines.append(
        (
            "all",
            f"{right}/{people.n} = {percent(right / people.n)} ({span(wilson(right, people.n))})",
            f"{right2}/{theirs.n} = {percent(right2 / theirs.n)} ({span(wilson(right2, theirs.n))})",
            *(f"{percent(robot.rate.mean)} ({span(robot.rate.interval)})" for robot in robots),
        )
    )
    return lines


def _of_state(condition: ConditionResult, state: str) -> OverSeeds:
    rates, n = [], 1
    for result in condition.by_seed.values():
        i = next(k for k, label in enumerate(result.confusion.labels) if label.endswith(state))
        row = result.confusion.counts[i]
        n = sum(row)
        rates.append(row[i] / n)
    return OverSeeds(tuple(rates), n)
