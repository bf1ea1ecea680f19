"""Runs tasks one after another in this process. A debugger can follow them; a crash of one ends the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from graspsense.experiments.task import Task, TaskResult, run_task


class Serial:
    """The executor `serial`."""

    workers = 1

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Run the tasks in order."""
        for task in tasks:
            yield TaskResult.from_text(run_task(task.to_text()))

    def close(self) -> None:
        """Do nothing: there are no workers."""
