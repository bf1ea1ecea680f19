"""How long an experiment takes, estimated from its number of trials and from measured processor times.

`durations.toml` holds processor seconds per trial, in which making the trial, training and judging are included. They
were measured by `benchmarks/experiment_times.py`; the file names the machine.
"""

from __future__ import annotations

import math
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from statistics import median
from typing import Any

from attrs import frozen

from graspsense.experiments.experiment import Planned, number_of_trials


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
        return duration_in_words(self.seconds / min(workers, self.tasks))


def effort_of(planned: Planned) -> Effort:
    """Return what an experiment consists of, with an estimate of the time."""
    per_trial = _measured()["seconds_per_trial"]
    trials, seconds, trainings = 0, 0.0, 0
    known = estimated = True
    for case in planned.cases:
        sources = [source for source in (case.data, case.test) if source is not None]
        counts = [number_of_trials(case.settings, source) for source in sources]
        number = sum(count for count in counts if count is not None)
        known = known and None not in counts
        trials += number
        targets, folds = len(getattr(case.judge, "targets", ())), getattr(case.judge, "folds", 1)
        trainings += len(case.learners) * targets * (folds if case.test is None else 1)
        name = case.part or planned.name
        share = per_trial.get(name) or per_trial.get(f"kind {case.kind}")
        estimated = estimated and share is not None
        seconds += number * (share or 0.0)
    seeds = len(planned.seeds)
    return Effort(
        cases=len(planned.cases),
        seeds=seeds,
        trials=trials * seeds if known else None,
        simulated=any(case.data.source == "simulated" for case in planned.cases),
        trainings=trainings * seeds,
        seconds=seconds * seeds if known and estimated else None,
    )


def measured_on() -> str:
    """Return what the estimates rest on: the processor on which the times were measured, and the date."""
    found = _measured()
    return f"estimated from times measured on {found['processor']} on {found['date']}"


def duration_in_words(seconds: float) -> str:
    """Return a duration to one or two digits: `40 s`, `15 min`, `2.5 h`."""
    if seconds < 100:
        return f"{max(math.ceil(seconds / 5) * 5, 5)} s"
    if seconds < 5400:
        return f"{math.ceil(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"


@cache
def _measured() -> Mapping[str, Any]:
    text = files("graspsense.experiments").joinpath("durations.toml").read_text(encoding="utf-8")
    values = tomllib.loads(text)
    shares, kinds = dict(values["seconds_per_trial"]), values["kinds"]
    # An experiment from a user's file is estimated from the shipped experiments of the same kind.
    for kind in dict.fromkeys(kinds.values()):
        shares[f"kind {kind}"] = median(shares[name] for name, of in kinds.items() if of == kind)
    return {**values, "seconds_per_trial": shares}
