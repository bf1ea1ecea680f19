"""The results of an experiment: the rate of each case, classifier and target over all seeds, and their differences."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import cached_property
from typing import Any

from attrs import evolve, field, frozen

from graspsense.core.components.caller import option
from graspsense.core.learn.labelled import Target, recognised
from graspsense.core.values.errors import ConfigError, counted, listed
from graspsense.core.values.label_text import natural_order
from graspsense.evaluation.intervals import RecognitionRate
from graspsense.evaluation.over_seeds import MeanDifference, OverSeeds, mean_difference
from graspsense.evaluation.results import Confusion
from graspsense.experiments.experiment import ExperimentCase, Planned
from graspsense.experiments.results import EXPERIMENT, PIPELINES, PROVENANCE, Results
from graspsense.experiments.task import TaskResult
from graspsense.experiments.task_results import (
    AnyTaskResult,
    ClassifierResult,
    RecognitionResult,
)
from graspsense.experiments.versions import differences


@frozen(kw_only=True)
class ControlOverSeeds:
    """A control over the seeds of a condition: what it is, and its rate or the reason why there is none."""

    what: str
    rate: OverSeeds | None
    reason: str


@frozen(kw_only=True, eq=False, slots=False)
class ConditionResult:
    """One case, evaluated with one classifier for one target, over the seeds that have results."""

    case: ExperimentCase
    classifier: str
    target: Target
    by_seed: Mapping[int, ClassifierResult]
    """At least one seed."""
    simulated: bool

    @property
    def name(self) -> str:
        """The name among the conditions of the same target: the case, and the classifier if there are several."""
        classifier = self.classifier if len(self.case.learners) > 1 or not self.case.name else ""
        return ", ".join(part for part in (self.case.name, classifier) if part)

    @property
    def first_seed(self) -> int:
        """The first seed that has a result."""
        return next(iter(self.by_seed))

    @property
    def of_first_seed(self) -> ClassifierResult:
        """The result of the first seed."""
        return self.by_seed[self.first_seed]

    @property
    def protocol(self) -> str:
        """The protocol of the rates."""
        return self.of_first_seed.protocol

    @property
    def recognised(self) -> Target:
        """What a correct prediction recognises: the target, or the class if labels have no state."""
        return recognised(self.target, self.of_first_seed.confusion.labels)

    @property
    def rates(self) -> dict[int, float]:
        """The rate of each seed."""
        return {seed: result.rate.rate for seed, result in self.by_seed.items()}

    @cached_property
    def rate(self) -> OverSeeds:
        """The rate over the seeds. Recorded trials are the same for every seed, so their mean is a single rate."""
        return self._over_seeds([result.rate for result in self.by_seed.values()])

    @cached_property
    def controls(self) -> dict[str, ControlOverSeeds]:
        """The controls over the seeds, by name."""
        controls = {}
        for name, control in self.of_first_seed.controls.items():
            measured = (result.controls[name].rate for result in self.by_seed.values())
            rates = [rate for rate in measured if rate is not None]
            rate = self._over_seeds(rates) if rates else None
            controls[name] = ControlOverSeeds(what=control.what, rate=rate, reason=control.reason)
        return controls

    @property
    def majority(self) -> OverSeeds | None:
        """The rate of always predicting the most frequent label, if it was measured."""
        control = self.controls.get("majority_class")
        return None if control is None else control.rate

    @property
    def confusion(self) -> Confusion:
        """The sum of the confusion matrices of all seeds."""
        matrices = [result.confusion for result in self.by_seed.values()]
        labels = natural_order(label for matrix in matrices for label in matrix.labels)
        place = {label: k for k, label in enumerate(labels)}
        counts = [[0] * len(labels) for _ in labels]
        for matrix in matrices:
            for label, row in zip(matrix.labels, matrix.counts, strict=True):
                for other, count in zip(matrix.labels, row, strict=True):
                    counts[place[label]][place[other]] += count
        return Confusion(tuple(labels), tuple(map(tuple, counts)))

    def minus(self, other: ConditionResult, comparisons: int = 1) -> MeanDifference | None:
        """Return this rate minus another's, paired by seed; None with fewer than two seeds.

        `comparisons` is the number of rates that are compared with the same one.
        """
        seeds = [seed for seed in self.rates if seed in other.rates]
        if len(seeds) < 2 or not self.simulated:
            return None
        minuend, subtrahend = ([classifier.rates[seed] for seed in seeds] for classifier in (self, other))
        return mean_difference(minuend, subtrahend, self.rate.n, comparisons)

    def _over_seeds(self, measured: list[RecognitionRate]) -> OverSeeds:
        rates = [rate.rate for rate in measured]
        single = measured[0]
        if not self.simulated:
            rates = [sum(rates) / len(rates)]
            # The same trials in other folds: the ends of the intervals are averaged as the rates are.
            intervals = [rate.interval for rate in measured if rate.interval is not None]
            if len(intervals) == len(measured):
                low, high = (sum(ends) / len(ends) for ends in zip(*intervals, strict=True))
                single = evolve(single, interval=(low, high))
        return OverSeeds(tuple(rates), self.of_first_seed.rate.n, single if len(rates) == 1 else None)


@frozen(kw_only=True, eq=False)
class Summary:
    """The results of an experiment: one condition per case, classifier and target."""

    planned: Planned
    conditions: tuple[ConditionResult, ...]
    results: Mapping[tuple[str, int], AnyTaskResult]
    """The result of each task, by the name of its case and the seed."""
    failed: tuple[TaskResult, ...]
    missing: int
    """Tasks without a result."""
    unreadable: tuple[str, ...] = field(default=())
    """The files of results that cannot be read, each with the reason."""
    other_versions: Mapping[str, int] = field(factory=dict)
    """How the versions of results differ from those of the last run, each with the number of the results."""
    seconds: float
    """Total time of all tasks."""
    cpu_seconds: float = 0.0
    """Total processor time of all tasks."""

    def recognition(self, case: str, seed: int) -> RecognitionResult | None:
        """Return the recognition result of this case and seed, None if there is none."""
        result = self.results.get((case, seed))
        return result if isinstance(result, RecognitionResult) else None

    @property
    def of_first_target(self) -> list[ConditionResult]:
        """The conditions of the first target."""
        return [condition for condition in self.conditions if condition.target == self.conditions[0].target]

    @property
    def alike(self) -> list[list[str]]:
        """The names of cases that have the same trials and the same answers to the last digit, for each such group.

        What differs between them has no effect. Of different parts, they may not differ at all. Cases with a source
        of their own to test on are left out, as their results do not hold those trials.
        """
        cases: dict[Any, list[str]] = {}
        for case in self.planned.cases:
            results = [self.recognition(case.name, seed) for seed in self.planned.seeds]
            content = tuple(
                (
                    result.trials,
                    *((each.classifier, each.target, each.confusion) for each in result.classifiers),
                )
                for result in results
                if result is not None and result.trials is not None
            )
            if case.test is None and len(content) == len(results):
                cases.setdefault((case.part, content), []).append(case.name)
        return [names for names in cases.values() if len(names) > 1]

    @property
    def doubts(self) -> list[str]:
        """A sentence each on results of other versions, and on cases whose results are the same."""
        return [
            *(
                f"{counted(number, 'result was', 'results were')} made with other versions than the last run has: {how}"
                for how, number in self.other_versions.items()
            ),
            *(
                f"{listed(list(map(repr, names)))}: all trials and answers are the same, so that what differs between "
                "these cases has no effect here"
                for names in self.alike
            ),
        ]

    @property
    def left_out(self) -> list[str]:
        """A sentence each on the tasks that failed, whose results cannot be read, or that have none yet."""
        lines = []
        if self.failed:
            reasons = list(dict.fromkeys(task.reason for task in self.failed))
            failed = counted(len(self.failed), "task failed and is", "tasks failed and are")
            lines.append(f"{failed} not included: {'; '.join(reasons[:5])}")
        if self.unreadable:
            lines.append(
                f"{counted(len(self.unreadable), 'result')} cannot be read, and not included: "
                f"{'; '.join(self.unreadable[:5])}. The same experiment with "
                f"{option('resume', python='resume=True')} computes them again"
            )
        if self.missing:
            missing = counted(
                self.missing, "task has no result yet and is", "tasks have no result yet and are"
            )
            lines.append(f"{missing} not included")
        return lines

    def as_json(self) -> dict[str, Any]:
        """Return the JSON form that `graspsense experiment --json` prints."""
        return {
            "experiment": self.planned.name,
            "title": self.planned.experiment.title,
            "question": self.planned.experiment.question,
            "seeds": list(self.planned.seeds),
            "conditions": [
                {
                    "case": condition.case.name,
                    "at": dict(condition.case.levels),
                    "classifier": condition.classifier,
                    "target": condition.target,
                    "protocol": condition.protocol,
                    "n": condition.rate.n,
                    "rates": {str(seed): rate for seed, rate in condition.rates.items()},
                    "rate": condition.rate.mean,
                    "interval": condition.rate.interval,
                    "prediction_interval": condition.rate.prediction,
                    "warnings": list(condition.of_first_seed.warnings),
                    "notes": list(condition.of_first_seed.notes),
                }
                for condition in self.conditions
            ],
            "failed": [{"task": task.name, "reason": task.reason} for task in self.failed],
            "missing": self.missing,
            **({"unreadable": list(self.unreadable)} if self.unreadable else {}),
            **({"alike": self.alike} if self.alike else {}),
            **({"other_versions": dict(self.other_versions)} if self.other_versions else {}),
            "seconds": self.seconds,
        }


def summarise(planned: Planned, results: Results) -> Summary:
    """Return the summary of the results in a folder."""
    by_condition: dict[tuple[str, str, Target], dict[int, ClassifierResult]] = {}
    decoded: dict[tuple[str, int], AnyTaskResult] = {}
    failed, unreadable, missing, seconds, cpu_seconds = [], [], 0, 0.0, 0.0
    of_last_run = results.provenance().get("versions")
    other_versions: Counter[str] = Counter()
    for case in planned.cases:
        for seed in planned.seeds:
            task_result, problem = results.read(planned.task(case, seed))
            if task_result is None:
                unreadable += [problem] if problem else []
                missing += not problem
                continue
            made = task_result.made
            seconds += made.seconds
            cpu_seconds += made.cpu_seconds
            if of_last_run and made.versions and (differ := differences(of_last_run, made.versions)):
                other_versions["; ".join(differ)] += 1
            result = task_result.decoded(case.kind)
            if result is None:
                failed.append(task_result)
                continue
            decoded[case.name, seed] = result
            if isinstance(result, RecognitionResult):
                for outcome in result.classifiers:
                    by_condition.setdefault((case.name, outcome.classifier, outcome.target), {})[seed] = (
                        outcome
                    )
    case_of = {case.name: case for case in planned.cases}
    return Summary(
        planned=planned,
        conditions=tuple(
            ConditionResult(
                case=case_of[case],
                classifier=classifier,
                target=target,
                by_seed=by_seed,
                simulated=decoded[case, next(iter(by_seed))].simulated,
            )
            for (case, classifier, target), by_seed in by_condition.items()
        ),
        results=decoded,
        failed=tuple(failed),
        missing=missing,
        unreadable=tuple(unreadable),
        other_versions=other_versions,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
    )


def summary_of(results: Results) -> Summary:
    """Return the summary of a folder by the experiment that lies in it.

    Raises ConfigError if the folder has results and none of them is of its experiment, which was changed after the run.
    """
    summary = summarise(results.experiment(), results)
    if not summary.results and not summary.failed and not summary.unreadable and results.any():
        made = results.provenance()
        again = f" ({made['command']})" if made.get("command") else ""
        raise ConfigError(
            f"{results.folder} has results, but none for the settings that it has now: {EXPERIMENT}, {PIPELINES}/, "
            f"{PROVENANCE} or graspsense itself was changed after the run{again}. Restore the files, or run the "
            f"changed experiment into another folder: graspsense experiment {results.folder / EXPERIMENT} --out FOLDER"
        )
    return summary
