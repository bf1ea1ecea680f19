"""Tasks in other processes on this machine. JSON lines pass between them, nothing else: no pickle, no live object.

A worker that dies takes its task along: that task is tried once more in a new worker, then it has failed.
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

from graspsense.experiments.executors.base import ExecutorLost
from graspsense.experiments.task import Task, TaskResult
from graspsense.experiments.versions import differences, versions

ATTEMPTS: Final = 2
ONE_THREAD: Final = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
"""Libraries that would start a thread a core in every worker."""
CLOSING_S: Final = 5.0


class Processes:
    """The executor `processes`."""

    def __init__(self, workers: int) -> None:
        self.workers = workers
        self._running: list[_Worker] = []

    def run(self, tasks: Sequence[Task]) -> Iterator[TaskResult]:
        """Do them, as many at once as there are workers. Raises ExecutorLost if no worker starts."""
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
                            # Last, so that it cannot take others along before they are done.
                            waiting.append(task)
                        else:
                            yield TaskResult.failed(task, f"it ended its worker {ATTEMPTS} times ({how})")
                    elif not worker.ready:
                        starts_lost += 1
                        if starts_lost > self.workers:
                            raise ExecutorLost(f"no worker starts ({how})")
                    if waiting and len(self._running) < self.workers:
                        self._start(selector)

    def close(self) -> None:
        """End the workers, whatever they are doing."""
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
    """One process, and the task that it is doing."""

    def __init__(self) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "graspsense.experiments.executors.worker"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**dict.fromkeys(ONE_THREAD, "1"), **os.environ},
            bufsize=0,
            # Ctrl-C is for this process alone, which then ends its workers.
            start_new_session=True,
        )
        assert self.process.stdout is not None
        self.out = self.process.stdout.fileno()
        self.task: Task | None = None
        self.ready = False
        self._begun = b""

    def begin(self, task: Task) -> None:
        """Send it a task. One that is gone is found out when it is read."""
        assert self.process.stdin is not None
        self.task = task
        data = memoryview(task.to_text().encode() + b"\n")
        with suppress(BrokenPipeError):
            while data:
                data = data[self.process.stdin.write(data) :]

    def read(self) -> tuple[list[str], bool]:
        """Return the lines that are there, and whether more may come."""
        data = os.read(self.out, 1 << 20)
        *lines, self._begun = (self._begun + data).split(b"\n")
        return [line.decode() for line in lines], bool(data)

    def ended(self) -> str:
        """Wait for its end and return how it ended."""
        code = self.process.wait()
        self._close()
        if code >= 0:
            return f"exit code {code}"
        with suppress(ValueError):
            return f"signal {signal.Signals(-code).name}"
        return f"signal {-code}"

    def end(self) -> None:
        """End it."""
        with suppress(ProcessLookupError):
            self.process.kill()
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(CLOSING_S)
        self._close()

    def _close(self) -> None:
        for pipe in (self.process.stdin, self.process.stdout):
            if pipe is not None:
                pipe.close()
