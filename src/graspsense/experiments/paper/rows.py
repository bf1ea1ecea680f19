"""Published rates compared with ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import frozen

from graspsense.evaluation.intervals import wilson
from graspsense.evaluation.over_seeds import OverSeeds
from graspsense.experiments.experiment import ExperimentCase
from graspsense.experiments.findings import percent, span
from graspsense.experiments.paper.published import Published, PublishedRate
from graspsense.experiments.summary import ConditionResult, Summary


@frozen(kw_only=True)
class RateComparison:
    """A published rate and ours over the seeds."""

    published: PublishedRate
    ours: OverSeeds

    @property
    def within(self) -> bool:
        """Whether the published rate is within the prediction interval of one more run of ours."""
        interval = self.ours.prediction
        return interval is not None and interval[0] <= self.published.rate <= interval[1]

    @property
    def indistinguishable(self) -> bool | None:
        """Whether our mean is within the interval of the published rate; None if that has none."""
        interval = self.published.interval
        return None if interval is None else interval[0] <= self.ours.mean <= interval[1]

    @property
    def cells(self) -> tuple[str, ...]:
        """The row of a table."""
        one = self.published
        its = one.interval
        near = self.indistinguishable
        return (
            one.where,
            one.what,
            one.basis,
            percent(one.printed),
            f"{one.correct}/{one.n} = {percent(one.rate)}, {span(its)}" if its else "counts not given",
            percent(self.ours.mean),
            span(self.ours.interval),
            span(self.ours.prediction),
            "yes" if self.within else "no",
            "not known" if near is None else ("yes" if near else "no"),
        )

    def as_json(self) -> dict[str, Any]:
        """Return the fields as JSON values."""
        one = self.published
        return {
            "id": one.id,
            "where": one.where,
            "what": one.what,
            "basis": one.basis,
            "printed": one.printed,
            "published": one.rate,
            "published_interval": None if one.interval is None else list(one.interval),
            "ours": self.ours.mean,
            "interval": list(self.ours.interval or ()),
            "prediction_interval": list(self.ours.prediction or ()),
            "seeds": len(self.ours.rates),
            "published_within_prediction": self.within,
            "ours_within_published_interval": self.indistinguishable,
            "note": one.note,
        }


HEADER = (
    "where",
    "what",
    "basis",
    "printed",
    "printed counts, 95 %",
    "our mean",
    "95 % of the mean",
    "95 % of one more run",
    "printed within that",
    "our mean within the printed 95 %",
)


def rows(summary: Summary, paper: Published) -> list[RateComparison]:
    """Return a comparison for each published rate that there are results for."""
    found = []
    for one in paper.rates:
        condition = condition_result(summary, one.experiment, one.target, one.at)
        if condition is None:
            continue
        rates = of_class(condition, one.class_) if one.class_ else condition.rate
        if rates is not None:
            found.append(RateComparison(published=one, ours=rates))
    return found


def condition_result(
    summary: Summary,
    experiment: str,
    target: str,
    at: Mapping[str, Any] | None = None,
    classifier: str = "c45",
) -> ConditionResult | None:
    """Return the condition of a case of an experiment, which may be part of another experiment; None if there is none.

    `at` holds the swept values of the case, as `ExperimentCase.at`.
    """
    for condition in summary.conditions:
        if (
            is_of(condition.case, summary, experiment, at)
            and condition.classifier == classifier
            and condition.target == target
        ):
            return condition
    return None


def is_of(
    case: ExperimentCase, summary: Summary, experiment: str, at: Mapping[str, Any] | None = None
) -> bool:
    """Return whether a case belongs to this experiment and has these swept values."""
    wanted = at or {}
    return (case.part or summary.planned.name) == experiment and all(
        case.at.get(key) == value for key, value in wanted.items()
    )


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


def people_beside_robot(paper: Published, robot: ConditionResult) -> list[tuple[str, ...]]:
    """Return one row per state: people (Table VI), the robot of the paper (Table V), and ours at 23 N."""
    people, theirs = paper.matrix("table_6").confusion, paper.matrix("table_5").confusion
    found: list[tuple[str, ...]] = []
    for i, state in enumerate(people.labels):
        right, of = people.counts[i][i], sum(people.counts[i])
        k = theirs.labels.index(state)
        right2, of2 = theirs.counts[k][k], sum(theirs.counts[k])
        rates = _of_state(robot, state)
        found.append(
            (
                state.replace("_", " "),
                f"{right}/{of} = {percent(right / of)} ({span(wilson(right, of))})",
                f"{right2}/{of2} = {percent(right2 / of2)} ({span(wilson(right2, of2))})",
                f"{percent(rates.mean)} ({span(rates.interval)})",
            )
        )
    right, right2 = people.correct, theirs.correct
    ours = robot.rate
    found.append(
        (
            "all",
            f"{right}/{people.n} = {percent(right / people.n)} ({span(wilson(right, people.n))})",
            f"{right2}/{theirs.n} = {percent(right2 / theirs.n)} ({span(wilson(right2, theirs.n))})",
            f"{percent(ours.mean)} ({span(ours.interval)})",
        )
    )
    return found


def _of_state(condition: ConditionResult, state: str) -> OverSeeds:
    rates, n = [], 1
    for result in condition.by_seed.values():
        i = next(k for k, label in enumerate(result.confusion.labels) if label.endswith(state))
        row = result.confusion.counts[i]
        n = sum(row)
        rates.append(row[i] / n)
    return OverSeeds(tuple(rates), n)
