"""Many grasps at once: in several processes, as the interpreter runs between the steps of MuJoCo.

The caller extracts the features. A grasp follows from its thing and its seed alone, whoever runs it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from queue import SimpleQueue
from typing import Any, Final

from attrs import asdict, evolve, field, frozen

from graspsense.plugin_api import Controller, SensorBackend
from graspsense.simulator_api import (
    BatchOptions,
    Grasped,
    GraspProcess,
    HandedGrasp,
    NotHandedOver,
    RunConfig,
    run_uninterrupted,
)
from graspsense_mujoco_gripper.config import MujocoConfig
from graspsense_mujoco_gripper.prepared import Batch

WORTH_A_PROCESS: Final = 4
"""Grasps that take about as long as the start of a process."""
TARGET: Final = "graspsense_mujoco_gripper.backend:grasps_in_process"


@frozen(eq=False)
class GraspingJob:
    """What all grasps of a batch have in common."""

    gripper: Callable[[MujocoConfig, Batch], SensorBackend[MujocoConfig]]
    """Makes a gripper that takes part in a batch."""
    config: MujocoConfig
    controller: Controller[Any]
    run: RunConfig
    batch: Batch = field(factory=Batch)
    """What the grasps of this process share."""

    def grasp(self, thing: str, seed: int) -> HandedGrasp:
        """Run one grasp here."""
        gripper = self.gripper(evolve(self.config, object=thing), self.batch)
        done = run_uninterrupted(gripper, self.controller, evolve(self.run, seed=int(seed)))
        return HandedGrasp(done.outcome, done.reason, done.trace, done.report)


def grasps(
    job: GraspingJob, things: Sequence[str], seeds: Sequence[int], options: BatchOptions, *, alone: bool
) -> list[Grasped]:
    """Return the grasp of each thing with its seed, in order; `alone`: all of them in this process.

    Raises ValueError if their numbers differ.
    """
    if len(things) != len(seeds):
        raise ValueError(f"{len(things)} scenes and {len(seeds)} seeds: give one seed a scene")
    wanted = options.get("workers") or os.cpu_count() or 1
    workers = 1 if alone else max(1, min(wanted, len(things) // WORTH_A_PROCESS))
    progress = options.get("progress")
    with _processes(job, workers) as free:

        def grasp(k: int) -> Grasped:
            process = free.get()
            try:
                if process is not None:
                    return _grasped(process.grasp(things[k], seeds[k]), options)
            except NotHandedOver:
                process = None
            finally:
                free.put(process)
            return _grasped(job.grasp(things[k], seeds[k]), options)

        done: list[Grasped] = []
        numbers = range(len(things))
        with ThreadPoolExecutor(max_workers=workers) as pool:
            try:
                for grasped in map(grasp, numbers) if workers == 1 else pool.map(grasp, numbers):
                    done.append(grasped)
                    if progress is not None:
                        progress(len(done), len(things))
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                raise
    return done


def _grasped(handed: HandedGrasp, options: BatchOptions) -> Grasped:
    extract, trace = options.get("extract"), handed.trace
    assert trace is not None
    return Grasped(
        outcome=handed.outcome,
        reason=handed.reason,
        extracted=None if extract is None else extract(trace),
        trace=trace if options.get("traces") else None,
        report=handed.further,
    )


@contextmanager
def _processes(job: GraspingJob, workers: int) -> Iterator[SimpleQueue[GraspProcess | None]]:
    """Yield the processes that are free, and end them; None stands for this process."""
    free: SimpleQueue[GraspProcess | None] = SimpleQueue()
    with ExitStack() as started:
        for _ in range(workers):
            process = None
            if workers > 1:
                with suppress(NotHandedOver):
                    process = started.enter_context(
                        GraspProcess(TARGET, job.controller, job.run, {"config": asdict(job.config)})
                    )
            free.put(process)
        yield free
