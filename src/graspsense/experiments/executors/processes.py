"""Runs tasks in other processes on this machine. The processes exchange lines of JSON and no pickled objects.

If a worker dies, its task is tried once more in a new worker. If that dies too, the task has failed.
"""

from __future__ import annotations

import json
import os
import selectors
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import suppress
from typing import Final

from graspsense.experiments.executors.executor import ExecutorLost
from graspsense.experiments.task import Task, TaskResult
from graspsense.experiments.versions import differences, versions

ATTEMPTS: Final = 2
ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables of libraries that would otherwise start one thread per core in every worker."""
CLOSING_S: Final = 5.0


class Processes:
    """The executor `processes`."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._running: list[_Worker] = []

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Run the tasks, as many at the same time as there are workers. Raises ExecutorLost if no worker starts."""
        waiting = deque(tasks)
        attempts: dict[str, int] = {}
        starts_lost = 0
        with selectors.DefaultSelector() as selector:
            for _ in range(min(self.workers, len(tasks))):
                self._start(selector)
            while waiting or any(worker.task for worker in self._running):
                for key, _ in selector.select():
                    worker: _Worker = key.data
                    lines, alive = worker.read()
                    for line in lines:
                        if not worker.ready:
                            worker.ready, starts_lost = True, 0
                            self._compare(line)
                        else:
                            worker.task = None
                            yield TaskResult.from_text(line)
                        if waiting:
                            worker.begin(waiting.popleft())
                    if alive:
                        continue
                    selector.unregister(worker.out)
                    self._running.remove(worker)
                    how, task = worker.ended(), worker.task
                    if task is not None:
                        attempts[task.key] = attempts.get(task.key, 0) + 1
                        if attempts[task.key] < ATTEMPTS:
                            # Tried again last, in case it ends further workers.
                            waiting.append(task)
                        else:
                            yield task.failed(f"it ended its worker {ATTEMPTS} times ({how})")
                    elif not worker.ready:
                        starts_lost += 1
                        if starts_lost > self.workers:
                            raise ExecutorLost(f"no worker starts ({how})")
                    if waiting and len(self._running) < self.workers:
                        self._start(selector)

    def close(self) -> None:
        """Stop the workers, whatever they are doing."""
        for worker in self._running:
            worker.end()
        self._running = []

    def _start(self, selector: selectors.BaseSelector) -> None:
        worker = _Worker()
        self._running.append(worker)
        selector.register(worker.out, selectors.EVENT_READ, worker)

    def _compare(self, hello: str) -> None:
        differs = differences(versions(), json.loads(hello))
        if differs:
            raise ExecutorLost(f"a worker has other versions: {'; '.join(differs)}")


class _Worker:
    """A worker process and the task that it is running."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-m", "graspsense.experiments.executors.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**dict.fromkeys(ONE_THREAD, "1"), **os.environ},
            bufsize=0,
            # Ctrl-C reaches only the parent process, which then stops its workers.
            start_new_session=True,
        )
        assert self.process.stdout is not None
        self.out = self.process.stdout.fileno()
        self.task: Task | None = None
        self.ready = False
        self._begun = b""

    def begin(self, task: Task) -> None:
        """Send the worker a task. Whether the worker is dead is noticed when its output is read."""
        assert self.process.stdin is not None
        self.task = task
        data = memoryview(task.to_text().encode() + b"\n")
        with suppress(BrokenPipeError):
            while data:
                data = data[self.process.stdin.write(data) :]

    def read(self) -> tuple[list[str], bool]:
        """Return the complete lines of its output, and whether more may follow."""
        data = os.read(self.out, 1 << 20)
        *lines, self._begun = (self._begun + data).split(b"\n")
        return [line.decode() for line in lines], bool(data)

    def ended(self) -> str:
        """Wait until the process has ended; return its exit code or signal as text."""
        code = self.process.wait()
        self._close()
        if code >= 0:
            return f"exit code {code}"
        with suppress(ValueError):
            return f"signal {signal.Signals(-code).name}"
        return f"signal {-code}"

    def end(self) -> None:
        """Kill the process."""
        with suppress(ProcessLookupError):
            self.process.kill()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(CLOSING_S)
        self._close()

    def _close(self) -> None:
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()
