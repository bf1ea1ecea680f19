"""What an experiment consists of, told before it runs."""

from __future__ import annotations

from attrs import frozen

from graspsense.experiments.cases import number_of_trials
from graspsense.experiments.experiment import Planned


@frozen(kw_only=True)
class Effort:
    """What an experiment consists of: tasks, trials (None if a data set would have to be read), and trained models.

    `trainings` counts a model for each classifier, fold and target of the reported rate; controls add to it.
    """

    cases: int
    seeds: int
    tasks: int
    trials: int | None
    trainings: int


def effort_of(planned: Planned) -> Effort:
    """Return what an experiment consists of."""
    seeds, trainings = len(planned.seeds), 0
    counts: list[int | None] = []
    for case in planned.cases:
        sources = [source for source in (case.data, case.test) if source is not None]
        counts += [number_of_trials(case.settings, source) for source in sources]
        targets, folds = len(getattr(case.judge, "targets", ())), getattr(case.judge, "folds", 1)
        trainings += len(case.learners) * targets * (folds if case.test is None else 1)
    known = [count for count in counts if count is not None]
    return Effort(
        cases=len(planned.cases),
        seeds=seeds,
        tasks=len(planned.cases) * seeds,
        trials=sum(known) * seeds if len(known) == len(counts) else None,
        trainings=trainings * seeds,
    )
