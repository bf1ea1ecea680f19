"""The interface of executors, and the one that runs tasks in this process."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from graspsense.experiments.task import Task, TaskResult, run_task


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
