"""Runs tasks on a Dask cluster, by the address of its scheduler."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from importlib import import_module
from typing import Any, Final, Literal

from graspsense.core.values.errors import ConfigError, PluginUnavailable, named
from graspsense.experiments.executors.executor import ExecutorLost
from graspsense.experiments.task import Task, TaskResult, run_task
from graspsense.experiments.versions import differences, versions

HINT: Final = 'the executor dask needs Dask: pip install "graspsense[dask]", or pip install dask distributed'
CONNECTING_S: Final = 10.0
WORKERS_COMING_S: Final = 30.0
LOOKING_S: Final = 2.0
"""Interval at which a run checks that its scheduler and its workers still exist."""
SETTLING_S: Final = 1.0
WITHOUT_WORKERS_S: Final = 60.0
"""Time to wait for workers that died to be restarted, as a nanny does within seconds."""


class DaskCluster:
    """The executor `dask`."""

    def __init__(self, address: str) -> None:
        try:
            # Imported only here, because the import takes a second.
            self._distributed = import_module("distributed")
        except ImportError as error:
            raise PluginUnavailable(f"{HINT} ({error})") from error
        try:
            self._client = self._distributed.Client(address, timeout=CONNECTING_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(
                f"no Dask scheduler answers at {address} within {CONNECTING_S:g} s ({error}). Start one with "
                "`dask scheduler`, and workers with `dask worker ADDRESS`"
            ) from error
        self._futures: list[Any] = []
        self._seen = time.monotonic()

    @property
    def workers(self) -> int:
        """Number of tasks that run at the same time."""
        return max(int(sum(self._client.nthreads().values())), 1)

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Run the tasks. A task whose worker died is run once more, at the end and alone.

        Raises ExecutorLost if the scheduler is lost, ConfigError if the versions of the workers differ.
        """
        self._compare()
        self._seen = time.monotonic()
        victims: list[Task] = []
        for task, text in self._answers(tasks, "first"):
            if text is None:
                victims.append(task)
            else:
                yield _done(task, text)
        # Alone, so that no other task can be the cause if the worker dies again.
        for task, text in self._answers(victims, "alone"):
            reason = "it ended its worker, also when it was tried again alone"
            yield task.failed(reason) if text is None else _done(task, text)

    def _answers(
        self, tasks: Sequence[Task], turn: Literal["first", "alone"]
    ) -> Iterator[tuple[Task, str | Exception | None]]:
        """Yield each task with its answer, the exception that prevented it, or None if its worker died.

        Only as many tasks are submitted as can run at the same time. A worker that dies therefore loses only tasks
        that were running, since the answers of finished tasks were fetched before.
        """
        distributed = self._distributed
        waiting = deque(tasks)
        running: dict[Any, Task] = {}
        try:
            while waiting or running:
                # The number of workers may change during the run.
                at_once = 1 if turn == "alone" else self.workers
                while waiting and len(running) < at_once:
                    if turn == "alone":
                        self._settle()
                    task = waiting.popleft()
                    # Only text is sent in both directions, so no object has to be pickled.
                    future = self._client.submit(
                        run_task,
                        task.to_text(),
                        key=f"graspsense-{turn}-{task.key}",
                        pure=False,
                    )
                    running[future] = task
                    self._futures = list(running)
                done = self._first(list(running))
                try:
                    answer: str | Exception | None = done.result(timeout=LOOKING_S)
                except distributed.KilledWorker:
                    answer = None
                except TimeoutError:
                    # Its worker died before the answer was fetched, so Dask is running it again.
                    self._watch()
                    continue
                except (OSError, distributed.CancelledError):
                    raise
                except Exception as error:
                    answer = error
                task = running.pop(done)
                done.release()
                yield task, answer
        except (OSError, distributed.CancelledError, RuntimeError) as error:
            raise ExecutorLost(f"{_GONE} ({named(error)})") from error

    def _settle(self) -> None:
        """Wait until the set of workers has stopped changing, so that none is still dying because of the last task.

        Raises ExecutorLost if there is no worker for too long.
        """
        known: set[str] = set()
        while True:
            now = set(self._client.nthreads())
            if now and now == known:
                return
            known = now
            self._watch()
            time.sleep(SETTLING_S)

    def _first(self, futures: Sequence[Any]) -> Any:
        """Wait until one of these is done and return it. Raises ExecutorLost if no worker is left."""
        distributed = self._distributed
        while True:
            with suppress(TimeoutError, distributed.TimeoutError):
                waited = distributed.wait(list(futures), timeout=LOOKING_S, return_when="FIRST_COMPLETED")
                return next(iter(waited.done))
            self._watch()

    def _watch(self) -> None:
        """Check scheduler and workers. Raises ExecutorLost if none is left."""
        if self._client.status != "running":
            raise ExecutorLost(_GONE)
        if self._client.nthreads():
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > WITHOUT_WORKERS_S:
            raise ExecutorLost(f"the Dask cluster has had no worker for {WITHOUT_WORKERS_S:g} s")

    def close(self) -> None:
        """Cancel the unfinished tasks."""
        with suppress(Exception):
            self._client.cancel(self._futures, force=True)
        with suppress(Exception):
            self._client.close(timeout=5)

    def _compare(self) -> None:
        """Raise ConfigError if no worker appears, or if one has other versions than this process."""
        try:
            self._client.wait_for_workers(1, timeout=WORKERS_COMING_S)
        except TimeoutError as error:
            raise ConfigError(
                f"the Dask scheduler has had no worker for {WORKERS_COMING_S:g} s: start some with "
                "`dask worker ADDRESS`"
            ) from error
        there = self._client.run(versions)
        differs = [
            f"{worker}: {line}"
            for worker, installed in there.items()
            for line in differences(versions(), installed)
        ]
        if differs:
            raise ConfigError(
                "workers have other versions than this process, so that their results would not be comparable:\n  "
                + "\n  ".join(differs)
            )


def _done(task: Task, answer: str | Exception) -> TaskResult:
    """Return the result of a task, from its answer or from the exception that prevented it."""
    if isinstance(answer, Exception):
        return task.failed(f"the worker failed: {named(answer)}")
    return TaskResult.from_text(answer)


_GONE: Final = "the Dask scheduler, or the connection to it, is gone"
