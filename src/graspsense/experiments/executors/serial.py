"""Tasks one after the other, in this process: a debugger sees them, and what kills a task kills the run."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from graspsense.experiments.task import Task, TaskResult, run_task


class Serial:
    """The executor `serial`."""

    workers = 1

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Do them in their order."""
        for task in tasks:
            yield TaskResult.from_text(run_task(task.to_text()))

    def close(self) -> None:
        """Do nothing: there are no workers."""
