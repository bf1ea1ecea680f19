"""Many grasps at once: in several processes, as the interpreter runs between the steps of MuJoCo.

The caller extracts the features. A grasp follows from its thing and its seed alone, whoever runs it.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, suppress
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
    progress, own, done = options.get("progress"), threading.local(), list[Grasped]()
    own.process = None

    def begin() -> None:
        own.process = None
        with suppress(NotHandedOver):
            own.process = started.enter_context(there())

    def grasp(thing: str, seed: int) -> Grasped:
        if own.process is not None:
            try:
                return _grasped(own.process.grasp(thing, seed), options)
            except NotHandedOver:
                own.process = None
        return _grasped(here(thing, seed), options)

    # A single worker is this thread, so that Ctrl-C ends its grasp.
    with ExitStack() as started, ThreadPoolExecutor(workers, initializer=begin) as pool:
        try:
            for grasped in (map if workers == 1 else pool.map)(grasp, things, seeds):
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
