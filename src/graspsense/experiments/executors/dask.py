"""Runs tasks on a Dask cluster: an existing one, by the address of its scheduler, or a local one made for the run."""

from __future__ import annotations

import os
import tempfile
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from importlib import import_module
from typing import Any, Final, Literal

from graspsense.core.components.caller import option
from graspsense.core.values.errors import ConfigError, PluginUnavailable, named
from graspsense.experiments.executors.base import ExecutorLost
from graspsense.experiments.task import Task, TaskResult, run_task
from graspsense.experiments.versions import differences, versions

HINT: Final = 'the executor dask needs Dask: pip install "graspsense[dask]", or pip install dask distributed'
LOOPBACK: Final = "127.0.0.1"
"""Where a cluster that was made for the run listens, dashboard included: no other machine can reach it."""
CONNECTING_S: Final = 10.0
WORKERS_COMING_S: Final = 30.0
LOOKING_S: Final = 2.0
"""Interval at which a run checks that its scheduler and its workers still exist."""
SETTLING_S: Final = 1.0
WITHOUT_WORKERS_S: Final = 60.0
"""Time to wait for workers that died to be restarted, as a nanny does within seconds."""


class DaskCluster:
    """The executor `dask`."""

    def __init__(self, address: str | None, workers: int) -> None:
        try:
            # Imported only here, because the import takes a second.
            dask, self._distributed = import_module("dask"), import_module("distributed")
        except ImportError as error:
            raise PluginUnavailable(f"{HINT} ({error})") from error
        self._cluster: Any = None
        self._wanted = workers
        self._local = ExitStack()
        if address is None:
            self._local.enter_context(_without_current_folder())
            # Dask imports from its folder for temporary files: with its default, other users could write there.
            scratch = tempfile.TemporaryDirectory(prefix="graspsense-", ignore_cleanup_errors=True)
            dask.config.set({"temporary-directory": self._local.enter_context(scratch)})
            # Dask retries a task once: its worker may have been dying because of another task.
            dask.config.set({"distributed.scheduler.allowed-failures": 1})
            self._cluster = self._local_cluster(workers)
        try:
            self._client = self._distributed.Client(address or self._cluster, timeout=CONNECTING_S)
        except (OSError, TimeoutError, ValueError) as error:
            raise ConfigError(
                f"no Dask scheduler answers at {address} within {CONNECTING_S:g} s ({error}). Start one with "
                "`dask scheduler`, and workers with `dask worker ADDRESS`"
            ) from error
        self._futures: list[Any] = []
        self._seen = time.monotonic()

    def _local_cluster(self, workers: int) -> Any:
        """Return a cluster on this machine. Raises ConfigError if none can be started, as without shared memory."""
        try:
            return self._distributed.LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host=LOOPBACK,
                dashboard_address=f"{LOOPBACK}:0",
                silence_logs=50,
            )
        except Exception as error:  # Dask raises various exceptions, from several layers
            self._local.close()
            cause: BaseException = error
            while cause.__cause__ is not None:
                cause = cause.__cause__
            raise ConfigError(
                f"no local Dask cluster can be started here: {named(error)} ({named(cause)}). Dask needs shared memory "
                f"(/dev/shm) and sockets of this machine. Use {option('executor', 'processes')}, or name a running "
                "scheduler"
            ) from error

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
            yield TaskResult.failed(task, reason) if text is None else _done(task, text)

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
        """Check scheduler and workers, and restart lost local ones. Raises ExecutorLost if none is left."""
        if self._client.status != "running":
            raise ExecutorLost(_GONE)
        if self._cluster is not None and len(self._cluster.workers) < self._wanted:
            # The nanny of a worker gives up after it has died several times.
            self._cluster.scale(self._wanted)
        if self._client.nthreads():
            self._seen = time.monotonic()
        elif time.monotonic() - self._seen > WITHOUT_WORKERS_S:
            raise ExecutorLost(f"the Dask cluster has had no worker for {WITHOUT_WORKERS_S:g} s")

    def close(self) -> None:
        """Cancel the unfinished tasks, and stop the cluster if it was made for the run."""
        with suppress(Exception):
            self._client.cancel(self._futures, force=True)
        with suppress(Exception):
            self._client.close(timeout=5)
        if self._cluster is not None:
            with suppress(Exception):
                self._cluster.close(timeout=5)
        self._local.close()

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


@contextmanager
def _without_current_folder() -> Iterator[None]:
    """Have the processes that begin meanwhile import nothing from the current folder.

    These are the workers, those that replace lost ones, and the process that tracks their resources.
    """
    name = "PYTHONSAFEPATH"
    users_own = os.environ.get(name)
    os.environ[name] = "1"
    try:
        yield
    finally:
        if users_own is None:
            os.environ.pop(name, None)
        else:
            os.environ[name] = users_own


def _done(task: Task, answer: str | Exception) -> TaskResult:
    """Return the result of a task, from its answer or from the exception that prevented it."""
    if isinstance(answer, Exception):
        return TaskResult.failed(task, f"the worker failed: {named(answer)}")
    return TaskResult.from_text(answer)


_GONE: Final = "the Dask scheduler, or the connection to it, is gone"
