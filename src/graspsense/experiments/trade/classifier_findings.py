"""The findings of a comparison of classifiers on the same folds, and of leaving out each feature."""

from __future__ import annotations

from collections.abc import Sequence

from attrs import frozen

from graspsense.experiments.findings import FoundTable, percent, span
from graspsense.experiments.summary import ConditionResult
from graspsense.experiments.trade.compare import WITHOUT
from graspsense.experiments.trade.cost_findings import Report
from graspsense.experiments.trade.paired import McNemar, corrected_t, mcnemar


@frozen(kw_only=True)
class _Comparison:
    """One classifier compared with the first one, over the seeds that both have."""

    condition: ConditionResult
    difference: tuple[float, tuple[float, float]] | None = None
    counts: McNemar | None = None
    t_test_p: float | None = None

    @property
    def name(self) -> str:
        return self.condition.classifier

    @property
    def is_better(self) -> bool:
        return self.difference is not None and self.difference[1][0] > 0.0

    @property
    def is_worse(self) -> bool:
        return self.difference is not None and self.difference[1][1] < 0.0

    @property
    def points(self) -> str:
        """The difference in percentage points."""
        return "" if self.difference is None else f"{100 * self.difference[0]:+.1f}"

    @property
    def cells(self) -> tuple[str, ...]:
        rate = self.condition.rate
        interval = (
            "" if self.difference is None else " to ".join(f"{100 * x:+.1f}" for x in self.difference[1])
        )
        return (
            self.name,
            percent(rate.mean),
            span(rate.interval),
            self.points,
            interval,
            "" if self.counts is None else f"{self.counts.only_first}:{self.counts.only_second}",
            "" if self.counts is None else f"{self.counts.p:.2g}",
            "" if self.t_test_p is None else f"{self.t_test_p:.2g}",
        )


def compare_classifiers(part: str, title: str, conditions: Sequence[ConditionResult]) -> Report:
    """Return the comparison of every classifier with the first one."""
    base = conditions[0]
    compared = [_Comparison(condition=one) if one is base else _compared(one, base) for one in conditions]
    classifiers = [one for one in compared if not one.name.startswith(WITHOUT)]
    reduced = [one for one in compared if one.name.startswith(WITHOUT)]
    text = _text(base, classifiers, reduced)
    header = (
        "classifier",
        "recognised",
        "95 % of the mean",
        f"points above {base.classifier}",
        "95 % of that",
        "McNemar counts",
        "McNemar p",
        "t-test p",
    )
    tables = [
        FoundTable(
            id=part,
            title=title,
            header=header,
            rows=tuple(one.cells for one in classifiers),
            note=f"{text} The McNemar counts are the trials that only this classifier, and only {base.classifier}, "
            "recognises; the test is exact, over the trials of all seeds. The t-test is the corrected resampled one, "
            "over the folds of all seeds.",
            numbers=1,
        )
    ]
    if reduced:
        tables.append(
            FoundTable(
                id=f"{part}_features",
                title="The effect of leaving out each feature",
                header=("features", *header[1:]),
                rows=tuple(one.cells for one in reduced),
                numbers=1,
            )
        )
    return Report(text=text, tables=tuple(tables))


def _text(base: ConditionResult, classifiers: Sequence[_Comparison], reduced: Sequence[_Comparison]) -> str:
    rate = f"{percent(base.rate.mean)} ({span(base.rate.interval)})"
    better = [f"{one.name} ({one.points} points)" for one in classifiers if one.is_better]
    needed = [f"{one.name.removeprefix(WITHOUT)} ({one.points} points)" for one in reduced if one.is_worse]
    if better:
        text = f"Compared with {base.classifier} ({rate}), these classifiers are better: {', '.join(better)}."
    else:
        text = f"No classifier is measurably better than {base.classifier} ({rate})."
    if needed:
        text += f" Leaving out one of these features lowers the rate: {', '.join(needed)}."
    elif reduced:
        text += " Leaving out any single feature does not measurably lower the rate."
    return text


def _compared(condition: ConditionResult, base: ConditionResult) -> _Comparison:
    first: list[bool] = []
    second: list[bool] = []
    by_fold: list[float] = []
    n = folds = 1
    for seed, result in condition.by_seed.items():
        if seed not in base.by_seed:
            continue
        correct, base_correct = result.correct or (), base.by_seed[seed].correct or ()
        first += correct
        second += base_correct
        fold_of = result.fold
        if fold_of is not None:
            n, folds = len(fold_of), max(fold_of) + 1
            for fold in range(folds):
                rows = [i for i, k in enumerate(fold_of) if k == fold]
                by_fold.append(sum(correct[i] - base_correct[i] for i in rows) / len(rows))
    return _Comparison(
        condition=condition,
        difference=condition.minus(base),
        counts=mcnemar(first, second),
        t_test_p=corrected_t(by_fold, n / folds, n - n / folds) if len(by_fold) > 1 else None,
    )
