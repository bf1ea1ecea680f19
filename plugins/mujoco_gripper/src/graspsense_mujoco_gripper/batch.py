"""Many grasps at once: in several processes, as the interpreter runs between the steps of MuJoCo.

The caller extracts the features. A grasp follows from its thing and its seed alone, whoever runs it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from queue import SimpleQueue
from typing import Final

from graspsense.simulator_api import BatchOptions, Grasped, GraspProcess, HandedGrasp, NotHandedOver

WORTH_A_PROCESS: Final = 4
"""Grasps that take about as long as the start of a process."""


def grasps(
    here: Callable[[str, int], HandedGrasp],
    there: Callable[[], GraspProcess],
    things: Sequence[str],
    seeds: Sequence[int],
    options: BatchOptions,
) -> list[Grasped]:
    """Return the grasp of each thing with its seed, in order, by processes that `there` makes, or else `here`.

    Raises ValueError if their numbers differ.
    """
    if len(things) != len(seeds):
        raise ValueError(f"{len(things)} scenes and {len(seeds)} seeds: give one seed a scene")
    workers = max(1, min(options.get("workers") or os.cpu_count() or 1, len(things) // WORTH_A_PROCESS))
    progress = options.get("progress")
    with _processes(there, workers) as free:

        def grasp(k: int) -> Grasped:
            process = free.get()
            try:
                if process is not None:
                    return _grasped(process.grasp(things[k], seeds[k]), options)
            except NotHandedOver:
                process = None
            finally:
                free.put(process)
            return _grasped(here(things[k], seeds[k]), options)

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
def _processes(there: Callable[[], GraspProcess], workers: int) -> Iterator[SimpleQueue[GraspProcess | None]]:
    """Yield the processes that are free, and end them; None stands for this process."""
    free: SimpleQueue[GraspProcess | None] = SimpleQueue()
    with ExitStack() as started:
        for _ in range(workers):
            process = None
            if workers > 1:
                with suppress(NotHandedOver):
                    process = started.enter_context(there())
            free.put(process)
        yield free
