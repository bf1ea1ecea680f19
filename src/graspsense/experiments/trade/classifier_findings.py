"""The findings of a comparison of classifiers on the same folds, and of leaving out each feature."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen

from graspsense.evaluation.intervals import percent, span
from graspsense.evaluation.over_seeds import MeanDifference
from graspsense.experiments.findings import FoundTable
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.compare import WITHOUT
from graspsense.experiments.trade.cost_findings import Report


@frozen(kw_only=True)
class _Comparison:
    """One classifier compared with the first one, over the seeds that both have."""

    condition: ConditionResult
    difference: MeanDifference | None = None

    @property
    def name(self) -> str:
        return self.condition.classifier

    @property
    def is_better(self) -> bool:
        return self.difference is not None and self.difference.interval[0] > 0.0

    @property
    def is_worse(self) -> bool:
        return self.difference is not None and self.difference.interval[1] < 0.0

    @property
    def points(self) -> str:
        """The difference in percentage points."""
        return "" if self.difference is None else f"{100 * self.difference.value:+.1f}"

    @property
    def cells(self) -> tuple[str, ...]:
        rate = self.condition.rate
        interval = (
            ""
            if self.difference is None
            else " to ".join(f"{100 * x:+.1f}" for x in self.difference.interval)
        )
        return (
            self.name,
            percent(rate.mean),
            span(rate.interval),
            self.points,
            interval,
            "" if self.difference is None else f"{self.difference.p:.2g}",
        )


def compare_classifiers(part: str, title: str, conditions: Sequence[ConditionResult]) -> Report:
    """Return the comparison of every classifier with the first one."""
    base = conditions[0]
    comparisons = max(len(conditions) - 1, 1)
    compared = [
        _Comparison(
            condition=condition, difference=None if condition is base else condition.minus(base, comparisons)
        )
        for condition in conditions
    ]
    classifiers = [classifier for classifier in compared if not classifier.name.startswith(WITHOUT)]
    reduced = [classifier for classifier in compared if classifier.name.startswith(WITHOUT)]
    text = _text(base, classifiers, reduced)
    header = (
        "classifier",
        "recognised",
        "95 % of the mean",
        f"points more than {base.classifier}",
        "95 % of the difference",
        "p",
    )
    tables = [
        FoundTable(
            id=part,
            title=title,
            header=header,
            rows=tuple(classifier.cells for classifier in classifiers),
            note=f"{text} Differences are paired by seed. Their intervals and p-values (Student's t) are corrected "
            f"for all {comparisons} comparisons with {base.classifier} by Bonferroni's method: an interval excludes "
            "zero exactly if p is below 0.05.",
            numbers=1,
        )
    ]
    if reduced:
        tables.append(
            FoundTable(
                id=f"{part}_features",
                title="The effect of leaving out each feature",
                header=("features", *header[1:]),
                rows=tuple(classifier.cells for classifier in reduced),
                numbers=1,
            )
        )
    return Report(text=text, tables=tuple(tables))


def _text(base: ConditionResult, classifiers: Sequence[_Comparison], reduced: Sequence[_Comparison]) -> str:
    rate = f"{percent(base.rate.mean)} ({span(base.rate.interval)})"
    better = [
        f"{classifier.name} ({classifier.points} points)"
        for classifier in classifiers
        if classifier.is_better
    ]
    needed = [
        f"{comparison.name.removeprefix(WITHOUT)} ({comparison.points} points)"
        for comparison in reduced
        if comparison.is_worse
    ]
    if len(base.by_seed) < 2:
        return (
            f"{base.classifier} recognises {rate}. With one seed, it cannot be told which classifiers differ."
        )
    if better:
        text = f"Compared with {base.classifier} ({rate}), these classifiers are better: {', '.join(better)}."
    else:
        text = f"No classifier is shown to be better than {base.classifier} ({rate})."
    if needed:
        text += f" Leaving out one of these features lowers the rate: {', '.join(needed)}."
    elif reduced:
        text += " No single feature is shown to lower the rate where it is left out."
    return text
