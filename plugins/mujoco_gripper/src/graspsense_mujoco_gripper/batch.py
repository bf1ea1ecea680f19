"""Many grasps at once: in several processes, as the interpreter runs between the steps of MuJoCo.

A process is a new interpreter that runs `batch_process`, so that the script of the caller is not imported a second
time. It reads lines of JSON, and answers with a line of JSON and the columns of the trace as numpy writes them. The
caller extracts the features. A grasp follows from its thing and its seed alone, whoever runs it.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from queue import SimpleQueue
from typing import IO, Any, Final

import numpy as np
from attrs import asdict, evolve, field, fields, frozen

from graspsense.gripper_api import Outcome, Phase
from graspsense.plugin_api import (
    ConfigError,
    Controller,
    GraspEvent,
    SensorBackend,
    Trace,
    UnknownName,
    create,
)
from graspsense.simulator_api import BatchOptions, Grasped, RunConfig, recipe_of, run_uninterrupted
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.prepared import Batch

WORTH_A_PROCESS: Final = 4
"""Grasps that take about as long as the start of a process."""
COLUMNS: Final = tuple(
    field.name for field in fields(Trace) if field.name not in ("units", "signals", "events")
)
"""The columns of a trace that a process hands over."""


class JobStaysHere(Exception):
    """A grasp cannot run in another process, or failed there; the caller runs it, which shows the reason."""


@frozen(eq=False)
class GraspingJob:
    """What all grasps of a batch have in common."""

    gripper: Callable[[MujocoConfig, Batch], SensorBackend[MujocoConfig]]
    """Makes a gripper that takes part in a batch."""
    config: MujocoConfig
    controller: Controller[Any]
    options: BatchOptions
    makes_signals: bool
    """Whether the gripper has further channels, which are not handed over."""
    batch: Batch = field(factory=Batch)
    """What the grasps of this process share."""

    def grasp(self, thing: str, seed: int) -> Grasped:
        """Run one grasp here."""
        run = evolve(self.options.get("run") or RunConfig(), seed=int(seed))
        gripper = self.gripper(evolve(self.config, object=thing), self.batch)
        done = run_uninterrupted(gripper, self.controller, run)
        return self._grasped(done.outcome, done.reason, done.trace, done.report)

    def _grasped(self, outcome: Outcome, reason: str, trace: Trace, report: dict[str, Any] | Any) -> Grasped:
        extract = self.options.get("extract")
        return Grasped(
            outcome=outcome,
            reason=reason,
            extracted=None if extract is None else extract(trace),
            trace=trace if self.options.get("traces") else None,
            report=report,
        )

    def greeting(self) -> bytes:
        """Return what a process has to know before its first grasp. Raises JobStaysHere."""
        if self.makes_signals:
            raise JobStaysHere
        try:
            name, values = recipe_of("controller", self.controller)
            twin = create("controller", name, **values)
            # Compared as text, because NaN is not equal to itself.
            if repr((twin.params(), twin.init())) != repr((self.controller.params(), self.controller.init())):
                raise JobStaysHere
            return line_of(
                {
                    "path": [folder or os.getcwd() for folder in sys.path],
                    "config": asdict(self.config),
                    "controller": [name, values],
                    "run": asdict(self.options.get("run") or RunConfig()),
                }
            )
        except (ConfigError, UnknownName, TypeError, ValueError) as error:
            raise JobStaysHere from error

    def grasp_in(self, process: subprocess.Popen[bytes], thing: str, seed: int) -> Grasped:
        """Run one grasp in a process. Raises JobStaysHere."""
        jobs, answers = process.stdin, process.stdout
        assert jobs is not None
        assert answers is not None
        try:
            jobs.write(line_of([thing, int(seed)]))
            jobs.flush()
            line = answers.readline()
            if not line.endswith(b"\n"):
                raise JobStaysHere
            answer = json.loads(line)
            columns = io.BytesIO(answers.read(answer["bytes"]))
            if "failed" in answer:
                raise JobStaysHere
            trace = _trace(columns, answer["events"])
        except (OSError, ValueError) as error:
            raise JobStaysHere from error
        return self._grasped(Outcome(answer["outcome"]), answer["reason"], trace, answer["report"])


def grasps(job: GraspingJob, things: Sequence[str], seeds: Sequence[int]) -> list[Grasped]:
    """Return the grasp of each thing with its seed, in order. Raises ValueError if their numbers differ."""
    if len(things) != len(seeds):
        raise ValueError(f"{len(things)} scenes and {len(seeds)} seeds: give one seed a scene")
    wanted = job.options.get("workers") or os.cpu_count() or 1
    workers = max(1, min(wanted, len(things) // WORTH_A_PROCESS))
    progress = job.options.get("progress")
    with _processes(job, workers) as free:

        def grasp(k: int) -> Grasped:
            process = free.get()
            try:
                if process is not None:
                    return job.grasp_in(process, things[k], seeds[k])
            except JobStaysHere:
                if process is not None:
                    process.kill()
                process = None
            finally:
                free.put(process)
            return job.grasp(things[k], seeds[k])

        done: list[Grasped] = []
        if workers == 1:
            for k in range(len(things)):
                done.append(grasp(k))
                if progress is not None:
                    progress(k + 1, len(things))
            return done
        with ThreadPoolExecutor(max_workers=workers) as pool:
            try:
                for grasped in pool.map(grasp, range(len(things))):
                    done.append(grasped)
                    if progress is not None:
                        progress(len(done), len(things))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    return done


@contextmanager
def _processes(job: GraspingJob, workers: int) -> Iterator[SimpleQueue[subprocess.Popen[bytes] | None]]:
    """Yield the processes that are free, and end them; None stands for this process."""
    free: SimpleQueue[subprocess.Popen[bytes] | None] = SimpleQueue()
    started: list[subprocess.Popen[bytes]] = []
    try:
        try:
            greeting = job.greeting() if workers > 1 else b""
        except JobStaysHere:
            greeting = b""
        for _ in range(workers):
            if not greeting:
                free.put(None)
                continue
            process = subprocess.Popen(
                [sys.executable, "-P", "-m", "graspsense_mujoco_gripper.batch_process"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
            )
            started.append(process)
            assert process.stdin is not None
            process.stdin.write(greeting)
            free.put(process)
        yield free
    finally:
        for process in started:
            process.kill()
            process.communicate()


def _trace(answers: IO[bytes], told: Sequence[Sequence[Any]]) -> Trace:
    parts: dict[str, Any] = {name: np.lib.format.read_array(answers, allow_pickle=False) for name in COLUMNS}
    events = tuple(GraspEvent(t_s, Phase(phase), what, source) for t_s, phase, what, source in told)
    return Trace(**parts, events=events)


def line_of(value: Any) -> bytes:
    """Return a value as a line of JSON."""
    return json.dumps(value).encode() + b"\n"
