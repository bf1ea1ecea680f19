"""Every published rate beside ours."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import frozen

from graspsense.evaluation.confusion import Confusion
from graspsense.evaluation.intervals import wilson
from graspsense.evaluation.over_seeds import OverSeeds
from graspsense.experiments.experiment import Case
from graspsense.experiments.findings import percent, span
from graspsense.experiments.paper.published import Published, PublishedRate
from graspsense.experiments.summary import Arm, Summary


@frozen(kw_only=True)
class Row:
    """A published rate, ours over the seeds, and how they lie to each other."""

    published: PublishedRate
    ours: OverSeeds

    @property
    def within(self) -> bool:
        """Whether the published rate lies where one further run of ours would."""
        low, high = self.ours.further
        return low <= self.published.rate <= high

    @property
    def indistinguishable(self) -> bool | None:
        """Whether ours lies in the interval of the published rate; None where that has none."""
        interval = self.published.interval
        return None if interval is None else interval[0] <= self.ours.mean <= interval[1]

    @property
    def cells(self) -> tuple[str, ...]:
        """Return it as a row of a table."""
        one = self.published
        its = one.interval
        near = self.indistinguishable
        return (
            one.where,
            one.what,
            one.sort,
            percent(one.printed),
            f"{one.correct}/{one.n} = {percent(one.rate)}, {span(its)}" if its else "counts not given",
            percent(self.ours.mean),
            span(self.ours.interval),
            span(self.ours.further),
            "yes" if self.within else "no",
            "not known" if near is None else ("yes" if near else "no"),
        )

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        one = self.published
        return {
            "id": one.id,
            "where": one.where,
            "what": one.what,
            "sort": one.sort,
            "printed": one.printed,
            "published": one.rate,
            "published_interval": None if one.interval is None else list(one.interval),
            "ours": self.ours.mean,
            "interval": list(self.ours.interval),
            "further": list(self.ours.further),
            "seeds": len(self.ours.rates),
            "published_within_further": self.within,
            "ours_within_published_interval": self.indistinguishable,
            "note": one.note,
        }


HEADER = (
    "where",
    "what",
    "ours is",
    "printed",
    "its counts and 95 %",
    "ours, mean",
    "95 % of the mean",
    "95 % of one more run",
    "published within that",
    "ours within the published 95 %",
)


def rows(summary: Summary, paper: Published) -> list[Row]:
    """Return a row for each published rate of which there are results."""
    found = []
    for one in paper.rates:
        arm = arm_of(summary, one.experiment, one.target, one.at)
        if arm is None:
            continue
        rates = of_class(arm, one.class_) if one.class_ else arm.rate
        if rates is not None:
            found.append(Row(published=one, ours=rates))
    return found


def arm_of(
    summary: Summary,
    experiment: str,
    target: str,
    at: Mapping[str, Any] | None = None,
    learner: str = "c45",
) -> Arm | None:
    """Return the arm of a case of an experiment, which may stand alone or be part of another one.

    `at` holds what the case differs in, as `Case.at`.
    """
    for arm in summary.arms:
        if is_of(arm.case, summary, experiment, at) and arm.learner == learner and arm.target == target:
            return arm
    return None


def is_of(case: Case, summary: Summary, experiment: str, at: Mapping[str, Any] | None = None) -> bool:
    """Return whether a case is of this experiment, and differs from its others in this."""
    wanted = at or {}
    return (case.part or summary.planned.name) == experiment and all(
        case.at.get(key) == value for key, value in wanted.items()
    )


def of_class(arm: Arm, name: str) -> OverSeeds | None:
    """Return the rates among the trials of one class, from the confusion matrices of the seeds."""
    rates, n = [], 0
    for judged in arm.judged.values():
        matrix = Confusion(tuple(judged["labels"]), tuple(map(tuple, judged["confusion"])))
        chosen = [i for i, label in enumerate(matrix.labels) if label.partition(":")[0] == name]
        total = sum(sum(matrix.counts[i]) for i in chosen)
        if total:
            rates.append(sum(matrix.counts[i][i] for i in chosen) / total)
            n = total
    return OverSeeds(tuple(rates), n) if rates else None


def people_beside_robot(paper: Published, robot: Arm) -> list[tuple[str, ...]]:
    """Return a row a state: people (Table VI), the paper's robot (Table V), and ours at 23 N."""
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


def _of_state(arm: Arm, state: str) -> OverSeeds:
    rates, n = [], 1
    for judged in arm.judged.values():
        i = next(k for k, label in enumerate(judged["labels"]) if label.endswith(state))
        row = judged["confusion"][i]
        n = sum(row)
        rates.append(row[i] / n)
    return OverSeeds(tuple(rates), n)
