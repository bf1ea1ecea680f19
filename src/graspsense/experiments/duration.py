"""How long an experiment takes, estimated from its number of trials and from measured processor times.

The entries of experiments and of their kinds have processor seconds per trial, in which making the trial, training and
judging are included. `benchmarks/experiment_times.py` measures them.
"""

from __future__ import annotations

import math
from typing import Final

from attrs import frozen

from graspsense.experiments.cases import number_of_trials
from graspsense.experiments.experiment import Planned
from graspsense.experiments.experiment_file import shipped
from graspsense.experiments.kinds import kind_of
from graspsense.experiments.timing import duration_in_words

ESTIMATED_FROM: Final = "estimated from times measured on Intel(R) Xeon(R) Processor at 2.0 GHz on 2026-11-22"
"""What the estimates rest on: the processor on which the times were measured, and the date."""


@frozen(kw_only=True)
class Effort:
    """What an experiment consists of: tasks, trials (None if a data set would have to be read), and trained models.

    `trainings` counts a model for each classifier, fold and target of the reported rate; controls add to it. `seconds`
    is the estimated processor time, None if there is no estimate.
    """

    cases: int
    seeds: int
    trials: int | None
    simulated: bool
    trainings: int
    seconds: float | None

    @property
    def tasks(self) -> int:
        """The number of tasks: every case with every seed."""
        return self.cases * self.seeds

    def time_on(self, workers: int) -> str:
        """Return the estimated time with this number of processes, in words."""
        if self.seconds is None:
            return "unknown"
        return duration_in_words(max(self.seconds / min(workers, self.tasks), 1.0), step_s=5)


def effort_of(planned: Planned) -> Effort:
    """Return what an experiment consists of, with an estimate of the time."""
    entries = {name: resource.entry for name, resource in shipped().items()}
    trials, seconds, trainings = 0.0, 0.0, 0
    for case in planned.cases:
        sources = [source for source in (case.data, case.test) if source is not None]
        counts = [number_of_trials(case.settings, source) for source in sources]
        number = sum(math.nan if count is None else count for count in counts)
        trials += number
        targets, folds = len(getattr(case.judge, "targets", ())), getattr(case.judge, "folds", 1)
        trainings += len(case.learners) * targets * (folds if case.test is None else 1)
        entry = entries.get(case.part or planned.name)
        share = None if entry is None else entry.seconds_per_trial
        if share is None:
            share = kind_of(case.kind).declared.entry.seconds_per_trial
        seconds += number * (math.nan if share is None else share)
    seeds = len(planned.seeds)
    return Effort(
        cases=len(planned.cases),
        seeds=seeds,
        trials=None if math.isnan(trials) else int(trials) * seeds,
        simulated=any(case.data.source == "simulated" for case in planned.cases),
        trainings=trainings * seeds,
        seconds=None if math.isnan(seconds) else seconds * seeds,
    )
