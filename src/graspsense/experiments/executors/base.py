"""What an executor is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Protocol

from graspsense.experiments.task import Done, Task


class ExecutorLost(Exception):
    """All that could do tasks is gone: a scheduler that was stopped, workers that do not start."""


class Executor(Protocol):
    """Does tasks and yields what came of each as soon as it is there, in any order.

    A task that cannot be done is a `Done` with its reason; only what ends the whole run is raised. Whatever was not
    yielded when the iterator ends or is closed was not done. Raises ExecutorLost.
    """

    @property
    def workers(self) -> int:
        """How many tasks it does at once."""

    def run(self, tasks: Sequence[Task]) -> Iterator[Done]:
        """Do them."""

    def close(self) -> None:
        """Let go of the workers, whatever they are doing."""
