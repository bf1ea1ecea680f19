"""What runs tasks, by the name that `--executor` gives: the interface, the executor of this process, and the choice."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from typing import Protocol

from graspsense.core.components.caller import option
from graspsense.core.values.errors import ConfigError, suggestion
from graspsense.experiments.task import Task, TaskResult, run_task

NAMES = ("serial", "processes", "dask:ADDRESS")


class ExecutorLost(Exception):
    """Nothing is left that could run tasks: the scheduler was stopped, or no worker starts."""


class Executor(Protocol):
    """Runs tasks and yields the result of each as soon as it is available, in any order.

    A task that fails yields a `TaskResult` with the reason. Tasks without a result when the iterator ends were not run.
    Raises ExecutorLost if the run cannot continue.
    """

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Run the tasks."""

    def close(self) -> None:
        """Stop the workers, whatever they are doing."""


class Serial:
    """Runs tasks one after another in this process. A debugger can follow them; a crash of one ends the run."""

    workers = 1

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Run the tasks in order."""
        for task in tasks:
            yield TaskResult.from_text(run_task(task.to_text()))

    def close(self) -> None:
        """Do nothing: there are no workers."""


def chosen(asked: str | None, workers: int | None = None) -> Callable[[], Executor]:
    """Return a function that makes the executor named `asked`. None stands for processes, or for serial on one core.

    Raises ConfigError for an unknown name, and for fewer than one worker.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if workers is not None and workers < 1:
        raise ConfigError(f"{option('workers', str(workers))}: give at least 1")
    number = workers or cores
    name, _, address = (asked or ("processes" if number > 1 else "serial")).partition(":")
    if name not in (("dask",) if address else ("serial", "processes")):
        raise ConfigError(
            f"there is no executor {asked!r}.{suggestion(name, NAMES)} There are {', '.join(NAMES)}, as in "
            "dask:tcp://10.0.0.1:8786"
        )
    if name == "serial":
        return Serial
    if name == "processes":
        from graspsense.experiments.executors.processes import Processes

        return lambda: Processes(number)
    from graspsense.experiments.executors.dask import DaskCluster

    return lambda: DaskCluster(address)
