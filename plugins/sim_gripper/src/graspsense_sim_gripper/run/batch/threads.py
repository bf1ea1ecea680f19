"""Simulating many grasps on all cores: compiled if numba is installed, otherwise in the interpreter.

Threads process slices of the batch in turn. A compiled loop runs in its thread without the interpreter lock. Grasps in
the interpreter run in one new process per thread (`worker`). The result of a grasp depends on its scene and seed only;
the number of workers changes the run time only.
"""

from __future__ import annotations

import math
import os
import threading
import warnings
from collections import Counter, deque
from collections.abc import Callable, Hashable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from functools import partial
from operator import index
from typing import Any, Final

from attrs import define, field

from graspsense.plugin_api import Controller, FeatureSet
from graspsense.simulator_api import BatchOptions, NotCompilable, NotHandedOver, RunConfig
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.batch.compiled_grasps import CompiledGrasps
from graspsense_sim_gripper.run.batch.job import (
    FinishedGrasp,
    Job,
    Measure,
    grasp_plain,
)
from graspsense_sim_gripper.run.batch.scenes import (
    Drawing,
    Scenes,
    SelectedScene,
    compiled_drawing,
    draw_numbers,
    is_drawing_kept,
    scene_key,
)
from graspsense_sim_gripper.run.batch.worker import PlainProcess
from graspsense_sim_gripper.run.build import build
from graspsense_sim_gripper.run.compiled.extraction import compiled_measure, is_measure_kept
from graspsense_sim_gripper.run.compiled.loop_code import CompiledLoops, is_kept
from graspsense_sim_gripper.run.compiled.padding import compiled_kinds
from graspsense_sim_gripper.scene.library import kinds_in

WORTH_COMPILING: Final = 350
"""Number of grasps with the same kinds of terms in this process from which compiling saves more time than it takes:
half a minute, in which the interpreter runs about so many grasps."""
WORTH_LOADING: Final = 16
"""The same where an earlier process has kept the compiled loop on disk."""
WORTH_COMPILING_DRAWING: Final = 10_000
"""Number of compiled grasps of this process from which it saves time to compile their drawing (a second, against 0.1 ms
a grasp)."""
WORTH_COMPILING_MEASURE: Final = 500
"""The same of what measures their features (1.4 s, against 2.7 ms a grasp for the six features)."""
WORTH_A_PROCESS: Final = 16
"""Number of grasps per worker in the interpreter from which a process, which starts in half a second, saves time."""
WORTH_A_WORKER: Final = 16
"""Number of grasps from which another worker is started."""
SLICE: Final = 32
"""Most grasps that a worker takes at once."""
SLICES_PER_WORKER: Final = 4
"""Number of slices of a worker in a batch too small for slices of `SLICE` grasps. With fewer, some workers would wait
for the last ones."""
SLICES_AHEAD: Final = 8
"""Number of slices per worker that are given to the workers at once: few results wait for earlier ones."""
PROGRESS_S: Final = 0.2
"""Time between two calls of the progress callback."""

_interpreted: Final[Counter[tuple[str, ...]]] = Counter()
"""Number of grasps of this process that were not worth compiling, by the kinds of their terms."""
_interpreted_around: Final[Counter[Hashable]] = Counter()
"""Number of compiled grasps of this process for which a part around the loop was not worth compiling, by the part."""


def job_of(
    config: SimConfig,
    controller: Controller[Any],
    options: BatchOptions,
    *,
    features: FeatureSet[Any] | None = None,
) -> Job:
    """Return the settings of a batch. Raises TypeError for an unknown option.

    `features`: the feature set whose features are verified.
    """
    unknown = options.keys() - BatchOptions.__annotations__.keys()
    if unknown:
        raise TypeError(f"run_many has no {sorted(unknown)}; it has {sorted(BatchOptions.__annotations__)}")
    return Job(
        config=config,
        controller=controller,
        run=options.get("run") or RunConfig(),
        extract=options.get("extract"),
        traces=options.get("traces", False),
        features=features,
    )


def grasps(
    job: Job, scenes: Sequence[str], seeds: Sequence[int], compiled: bool | None, options: BatchOptions
) -> Iterator[FinishedGrasp]:
    """Simulate a grasp of each scene with its seed, and yield the results one by one, in that order.

    The results are the same for any number of workers. `compiled`: True compiles every loop, False none; None compiles
    where so many grasps have the same kinds of terms that it saves time. If numba is missing, or a controller or term
    cannot be compiled, the loop runs in the interpreter, and a warning gives the reason.

    Raises ValueError if there are not as many seeds as scenes, UnknownName for an unknown object, and ConfigError if
    the object cannot be read or no model reaches the accuracy.
    """
    if len(scenes) != len(seeds):
        raise ValueError(f"{len(scenes)} scenes and {len(seeds)} seeds: give one seed a scene")
    workers = options.get("workers") or os.cpu_count() or 1
    batch = _Batch(job, scenes, seeds, max(1, workers), compiled)
    try:
        yield from batch.grasps(options.get("progress"))
    finally:
        for note in batch.notes:
            warnings.warn(note, stacklevel=2)


@define(eq=False)
class _Batch:
    job: Job
    scenes: Sequence[str]
    seeds: Sequence[int]
    workers: int
    compiled: bool | None
    notes: dict[str, None] = field(factory=dict, init=False)
    """Remarks on how the grasps ran, as keys, so that each is given once."""
    drawing: Drawing = field(default=draw_numbers, init=False)
    """What draws the compiled grasps, compiled or not."""
    measure: Measure | None = field(default=None, init=False)
    """The compiled form of `Job.extraction`."""
    models: Scenes = field(init=False)
    counts: Counter[tuple[str, ...]] = field(factory=Counter, init=False)
    """Number of grasps by the kinds of terms in their loop."""
    is_compiled: dict[tuple[str, ...], bool] = field(factory=dict, init=False)
    """Whether loops with these kinds of terms are compiled."""
    loops: CompiledLoops = field(init=False)
    local: threading.local = field(factory=threading.local, init=False)
    """The compiled grasps of each thread, and its process for those in the interpreter."""
    processes: ExitStack = field(factory=ExitStack, init=False)

    @loops.default
    def _loops(self) -> CompiledLoops:
        return CompiledLoops(type(self.job.controller).step)

    @models.default
    def _models(self) -> Scenes:
        return Scenes(self.job)

    def grasps(self, progress: Callable[[int, int], None] | None) -> Iterator[FinishedGrasp]:
        """Run all grasps and yield their results in order; `progress(finished, total)` is called now and then.

        Results are not collected here, so that a caller that keeps little needs little memory.
        """
        total, finished = len(self.scenes), 0
        self._plan()
        workers = max(1, min(self.workers, math.ceil(total / WORTH_A_WORKER)))
        slices, running = deque(slices_of(total, workers)), deque[tuple[range, Future[list[FinishedGrasp]]]]()
        with self.processes, ThreadPoolExecutor(max_workers=workers) as pool:
            try:
                while slices or running:
                    while slices and len(running) < SLICES_AHEAD * workers:
                        which = slices.popleft()
                        running.append((which, pool.submit(self._slice, which)))
                    if progress is not None:
                        progress(finished, total)
                    which, future = running[0]
                    if wait([future], PROGRESS_S).done:
                        yield from future.result()
                        finished += len(which)
                        running.popleft()
                if progress is not None:
                    progress(finished, total)
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                # This ends the processes, so that no thread keeps waiting for one.
                self.processes.close()
                raise

    def _plan(self) -> None:
        """Decide which scenes are compiled, and select their models. Raises as `Scenes.add` does."""
        # In the order of the scenes, so that an error names the first unknown scene.
        names = {scene_key(scene): scene for scene in reversed(self.scenes)}
        grasps = Counter(scene_key(scene) for scene in self.scenes)
        kinds = {key: compiled_kinds(kinds_in(names[key])) for key in grasps}
        for key, n in grasps.items():
            self.counts[kinds[key]] += n
        for key in grasps:
            own = kinds[key]
            if own not in self.is_compiled:
                self.is_compiled[own] = (
                    self._is_worth_compiling(own, names[key]) if self.compiled is None else self.compiled
                )
        for key in grasps:
            self.models.add(names[key], compiled=self.is_compiled[kinds[key]])
        if any(self.is_compiled.values()):
            self._compile_around_the_loop()

    def _is_worth_compiling(self, kinds: tuple[str, ...], scene: str) -> bool:
        """Return whether a compiled loop saves time for the grasps with these kinds of terms, as those of `scene`."""
        n = self.counts[kinds]
        if n + _interpreted[kinds] >= WORTH_COMPILING:
            return True
        if n >= WORTH_LOADING:
            job = self.job
            usual = SelectedScene(job, build(job.config, scene), None).composition
            composition = usual._replace(kinds=kinds, converges=job.config.fidelity == "reference")
            if is_kept(composition, type(job.controller).step):
                return True
        _interpreted[kinds] += n
        return False

    def _compile_around_the_loop(self) -> None:
        """Compile what each compiled grasp does before and after its loop, where that saves time."""
        try:
            if self._is_worth_compiling_around(draw_numbers, WORTH_COMPILING_DRAWING, is_drawing_kept):
                self.drawing = compiled_drawing()
        except NotCompilable:
            # The loop cannot be compiled either, and says why.
            return
        form = self.job.extraction
        if form is not None:
            try:
                is_kept = partial(is_measure_kept, form)
                if self._is_worth_compiling_around(form.measure, WORTH_COMPILING_MEASURE, is_kept):
                    self.measure = compiled_measure(form)
            except NotCompilable as error:
                self.notes[f"features are extracted from traces, which takes longer: {error}"] = None

    def _is_worth_compiling_around(self, part: Hashable, worth: int, is_kept: Callable[[], bool]) -> bool:
        """Return whether it saves time to compile a part around the loop, from `worth` grasps on.

        Raises NotCompilable as `is_kept` does.
        """
        n = sum(count for kinds, count in self.counts.items() if self.is_compiled[kinds])
        if self.compiled or n + _interpreted_around[part] >= worth or is_kept():
            return True
        _interpreted_around[part] += n
        return False

    def _slice(self, which: range) -> list[FinishedGrasp]:
        """Run the grasps with these indices."""
        part = slice(which.start, which.stop)
        return [
            self._compiled(scene, seed) or self._plain(scene, seed)
            for scene, seed in zip(self.scenes[part], map(index, self.seeds[part]), strict=True)
        ]

    def _compiled(self, scene: str, seed: int) -> FinishedGrasp | None:
        """Return the result of a compiled grasp; None if it has to run in the interpreter."""
        kinds = self.models.find(scene).composition.kinds
        if not self.is_compiled[kinds]:
            return None
        try:
            if not hasattr(self.local, "grasps"):
                self.local.grasps = CompiledGrasps(self.models, self.loops, self.drawing, self.measure)
            grasps: CompiledGrasps = self.local.grasps
            return grasps.grasp(scene, seed)
        except NotCompilable as error:
            self.is_compiled[kinds] = False
            how = f"on {self.workers} cores" if self._worth_processes() else "on one core"
            self.notes[f"these grasps run in plain Python {how}, about a hundred times slower: {error}"] = (
                None
            )
            return None

    def _worth_processes(self) -> bool:
        """Return whether separate processes save time for the grasps in the interpreter."""
        plain = sum(n for kinds, n in self.counts.items() if not self.is_compiled[kinds])
        return self.workers > 1 and plain >= WORTH_A_PROCESS * self.workers

    def _plain(self, scene: str, seed: int) -> FinishedGrasp:
        """Return the result of a grasp in the interpreter: of another process, if that saves time."""
        local = self.local
        if self._worth_processes() and not getattr(local, "without_process", False):
            try:
                if not hasattr(local, "process"):
                    local.process = self.processes.enter_context(PlainProcess(self.models))
                done: FinishedGrasp = local.process.run(scene, seed)
                return done
            except NotHandedOver as error:
                local.without_process = True
                self.notes[f"plain grasps run on one core: {error}"] = None
        return grasp_plain(self.job, self.models.setup(scene, seed), self.models.find(scene).model)


def slices_of(total: int, workers: int) -> list[range]:
    """Return the indices of the grasps that a worker takes at once, slice by slice."""
    length = max(1, min(SLICE, math.ceil(total / (SLICES_PER_WORKER * workers))))
    return [range(begin, min(begin + length, total)) for begin in range(0, total, length)]
