"""What came out: the rate of each case, classifier and target over all seeds, and what it differs from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from attrs import frozen

from graspsense.evaluation.confusion import Confusion
from graspsense.evaluation.over_seeds import OverSeeds, mean_difference
from graspsense.experiments.experiment import Case, Planned
from graspsense.experiments.results import Results
from graspsense.experiments.task import Done


@frozen(kw_only=True, eq=False)
class Arm:
    """One case, judged by one classifier for one target, over the seeds of which there are results.

    `judged` holds what the task `recognise` found, by seed.
    """

    case: Case
    learner: str
    target: str
    judged: Mapping[int, Mapping[str, Any]]
    simulated: bool

    @property
    def name(self) -> str:
        """What tells it from the others that are judged for the same target."""
        learner = self.learner if len(self.case.learners) > 1 or not self.case.name else ""
        return ", ".join(part for part in (self.case.name, learner) if part)

    @property
    def protocol(self) -> str:
        """The folds by which it was judged."""
        return str(next(iter(self.judged.values()))["protocol"])

    @property
    def tells(self) -> str:
        """What is told by right answers: the target, or the class where labels have no state."""
        labels = next(iter(self.judged.values()))["labels"]
        return "class" if self.target == "both" and not any(":" in one for one in labels) else self.target

    @property
    def rates(self) -> dict[int, float]:
        """The rate of each seed."""
        return {seed: float(one["rate"]) for seed, one in self.judged.items()}

    @property
    def rate(self) -> OverSeeds:
        """The rate over the seeds.

        On recorded trials seeds only deal the same trials to other folds: they count as one run.
        """
        first = next(iter(self.judged.values()))
        rates = tuple(self.rates.values())
        if not self.simulated:
            rates = (sum(rates) / len(rates),)
        return OverSeeds(rates, int(first["n"]))

    @property
    def controls(self) -> dict[str, tuple[str, OverSeeds | None, str]]:
        """Each control: what it is, its rate over the seeds, or the reason why there is none."""
        found: dict[str, tuple[str, OverSeeds | None, str]] = {}
        first = next(iter(self.judged.values()))
        for name, one in first["controls"].items():
            rates = [each["controls"][name]["rate"] for each in self.judged.values()]
            known = [float(rate) for rate in rates if rate is not None]
            if known and not self.simulated:
                known = [sum(known) / len(known)]
            rate = OverSeeds(tuple(known), int(first["n"])) if known else None
            found[name] = (str(one["what"]), rate, str(one.get("reason", "")))
        return found

    @property
    def confusion(self) -> Confusion:
        """The confusion matrices of all seeds, added up."""
        labels = sorted({label for one in self.judged.values() for label in one["labels"]})
        at = {label: k for k, label in enumerate(labels)}
        counts = [[0] * len(labels) for _ in labels]
        for one in self.judged.values():
            for label, row in zip(one["labels"], one["confusion"], strict=True):
                for other, count in zip(one["labels"], row, strict=True):
                    counts[at[label]][at[other]] += count
        return Confusion(tuple(labels), tuple(map(tuple, counts)))

    def less(self, other: Arm) -> tuple[float, tuple[float, float]] | None:
        """Return this rate less another's, seed by seed, with its interval; None with fewer than two seeds."""
        seeds = [seed for seed in self.rates if seed in other.rates]
        if len(seeds) < 2 or not self.simulated:
            return None
        return mean_difference([self.rates[s] for s in seeds], [other.rates[s] for s in seeds], self.rate.n)


@frozen(kw_only=True, eq=False)
class Summary:
    """Everything that came of an experiment: an arm a case, classifier and target; what failed; what is missing."""

    planned: Planned
    arms: tuple[Arm, ...]
    results: Mapping[tuple[str, int], Mapping[str, Any]]
    """Result of each task by name of the case and seed."""
    failed: tuple[Done, ...]
    missing: int
    seconds: float
    """Time that all tasks took, added up."""
    cpu_seconds: float = 0.0
    """Processor time of the same."""

    def arm(self, case: str = "", learner: str | None = None, target: str | None = None) -> Arm:
        """Return the first arm of this case, and of this classifier and target where they are given. KeyError."""
        for one in self.arms:
            if one.case.name == case and learner in (None, one.learner) and target in (None, one.target):
                return one
        raise KeyError(f"no arm of case {case!r}, classifier {learner!r}, target {target!r}")

    def as_json(self) -> dict[str, Any]:
        """Return it as JSON values."""
        return {
            "experiment": self.planned.name,
            "title": self.planned.experiment.title,
            "question": self.planned.experiment.question,
            "seeds": list(self.planned.seeds),
            "arms": [
                {
                    "case": one.case.name,
                    "at": dict(one.case.at),
                    "classifier": one.learner,
                    "target": one.target,
                    "protocol": one.protocol,
                    "n": one.rate.n,
                    "rates": {str(seed): rate for seed, rate in one.rates.items()},
                    "rate": one.rate.mean,
                    "interval": list(one.rate.interval),
                    "further": list(one.rate.further),
                }
                for one in self.arms
            ],
            "failed": [{"task": one.name, "reason": one.reason} for one in self.failed],
            "missing": self.missing,
            "seconds": self.seconds,
        }


def summarise(planned: Planned, results: Results) -> Summary:
    """Return what the results in a folder say of this experiment."""
    judged: dict[tuple[str, str, str], dict[int, Mapping[str, Any]]] = {}
    simulated: dict[str, bool] = {}
    kept: dict[tuple[str, int], Mapping[str, Any]] = {}
    failed, missing, seconds, cpu_seconds = [], 0, 0.0, 0.0
    for case in planned.cases:
        for seed in planned.seeds:
            done = results.get(planned.task(case, seed).key)
            if done is None:
                missing += 1
                continue
            seconds += done.seconds
            cpu_seconds += float(done.made.get("cpu_seconds", 0.0))
            if done.result is None:
                failed.append(done)
                continue
            kept[case.name, seed] = done.result
            simulated[case.name] = bool(done.result.get("simulated", False))
            for one in done.result.get("judged", ()):
                judged.setdefault((case.name, one["learner"], one["target"]), {})[seed] = one
    of = {case.name: case for case in planned.cases}
    return Summary(
        planned=planned,
        arms=tuple(
            Arm(case=of[case], learner=learner, target=target, judged=by_seed, simulated=simulated[case])
            for (case, learner, target), by_seed in judged.items()
        ),
        results=kept,
        failed=tuple(failed),
        missing=missing,
        seconds=seconds,
        cpu_seconds=cpu_seconds,
    )
