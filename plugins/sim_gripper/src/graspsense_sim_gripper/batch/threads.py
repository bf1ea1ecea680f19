"""Many grasps at once: the compiled loop on all cores where numba is there, the plain one where it is not.

Threads take slices of the batch in turn. A compiled loop runs in its thread, without the interpreter's lock; a plain
one in a process of that thread's, since plain loops would wait for each other. What a grasp gives follows from its
scene and seed alone, so the number of workers decides nothing but the time.
"""

from __future__ import annotations

import os
import threading
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack
from typing import Any, Final, Unpack

from attrs import define, field

from graspsense.plugin_api import (
    BatchOptions,
    Controller,
    NotCompilable,
    RunConfig,
    entry_point,
    first_call,
)
from graspsense_sim_gripper import kernel
from graspsense_sim_gripper.batch.job import (
    Composition,
    Done,
    Job,
    Storage,
    chooser_of,
    composition_of,
    grasp_compiled,
    loop_of,
    plainly,
)
from graspsense_sim_gripper.batch.worker import NotHandedOver, PlainProcess
from graspsense_sim_gripper.compiled.padding import as_compiled, compiled_kinds
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.objects.library import kinds_in, split_number
from graspsense_sim_gripper.setting import Chooser, Setting, set_scene

WORTH_COMPILING: Final = 50
"""Grasps of one composition from which compiling it takes less time than it saves."""
WORTH_A_PROCESS: Final = 16
"""Plain grasps a worker from which starting a process for them, half a second, takes less time than it saves."""
SLICE: Final = 16
AHEAD: Final = 8
"""Slices a worker that are done before one that takes long."""
REPORT_S: Final = 0.2

_COMPILING: Final = threading.Lock()


def run_many(
    config: SimConfig,
    controller: Controller[Any],
    scenes: Sequence[str],
    seeds: Sequence[int],
    *,
    compiled: bool | None = None,
    **options: Unpack[BatchOptions],
) -> list[Done]:
    """Grasp each scene with its seed and return what came of each in that order, the same for any number of workers.

    Traces are kept unless the options say otherwise. `compiled` asks for compiling or forbids it; by default a
    composition is compiled from `WORTH_COMPILING` grasps on. Where a controller or a term cannot be compiled the
    plain loop runs, and a warning says why.
    """
    return list(grasps(config, controller, scenes, seeds, compiled, {"traces": True, **options}))


def grasps(
    config: SimConfig,
    controller: Controller[Any],
    scenes: Sequence[str],
    seeds: Sequence[int],
    compiled: bool | None,
    options: BatchOptions,
) -> Iterator[Done]:
    """Yield what `run_many` returns, one after the other."""
    unknown = options.keys() - BatchOptions.__annotations__.keys()
    if unknown:
        raise TypeError(f"run_many has no {sorted(unknown)}; it has {sorted(BatchOptions.__annotations__)}")
    if len(scenes) != len(seeds):
        raise ValueError(f"{len(scenes)} scenes and {len(seeds)} seeds: give one seed a scene")
    job = Job(
        config=config,
        controller=controller,
        run=options.get("run") or RunConfig(),
        extract=options.get("extract"),
        traces=options.get("traces", False),
    )
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
    """What is to be said of how they ran, each once."""
    chooser: Chooser = field(init=False)
    of_kinds: Counter[tuple[str, ...]] = field(factory=Counter, init=False)
    counts: Counter[Composition] = field(factory=Counter, init=False)
    fast: dict[Composition, bool] = field(factory=dict, init=False)
    """Which compositions run compiled."""
    loops: dict[Composition, Callable[..., Any]] = field(factory=dict, init=False)
    """The compiled loops that have run once."""
    own: threading.local = field(factory=threading.local, init=False)
    processes: ExitStack = field(factory=ExitStack, init=False)

    def grasps(self, progress: Callable[[int, int], None] | None) -> Iterator[Done]:
        """Run them all; yield what came of each in order, so that who keeps little of it holds little."""
        total = len(self.scenes)
        self._plan()
        slices = range(0, total, SLICE)
        workers = max(1, min(self.workers, len(slices)))
        running: dict[Future[list[Done]], int] = {}
        ready: dict[int, list[Done]] = {}
        asked = given = finished = 0
        with self.processes, ThreadPoolExecutor(max_workers=workers) as pool:
            try:
                while True:
                    # A slice a worker and one in reserve: nothing piles up, and an interruption is soon heard.
                    while len(running) < 2 * workers and asked < min(len(slices), given + AHEAD * workers):
                        running[pool.submit(self._slice, slices[asked])] = asked
                        asked += 1
                    if progress is not None:
                        progress(finished, total)
                    if not running:
                        break
                    for future in wait(running, REPORT_S, FIRST_COMPLETED).done:
                        k = running.pop(future)
                        ready[k] = future.result()
                        finished += len(ready[k])
                    while given in ready:
                        yield from ready.pop(given)
                        given += 1
            except BaseException:
                pool.shutdown(wait=False, cancel_futures=True)
                # Whoever waits for a process is then told that it has gone.
                self.processes.close()
                raise

    def __attrs_post_init__(self) -> None:
        self.chooser = chooser_of(self.job, self._trial_loop)

    def _plan(self) -> None:
        """Decide what is compiled, and choose the models; names that nobody knows are refused here."""
        names = Counter(scene if scene == "none" else split_number(scene)[0] for scene in self.scenes)
        for name, n in names.items():
            self.of_kinds[compiled_kinds(kinds_in(name))] += n
        for name, n in names.items():
            composition = composition_of(self.job.config, self._setting(name, 0))
            self.counts[composition] += n
        for composition, n in self.counts.items():
            self.fast[composition] = self._worth(n)

    def _worth(self, n: int) -> bool:
        return n >= WORTH_COMPILING if self.compiled is None else self.compiled

    def _setting(self, scene: str, seed: int) -> Setting:
        return set_scene(self.job.config, scene, seed, self.chooser)

    def _trial_loop(
        self, setting: Setting, step: Callable[..., Any]
    ) -> tuple[Callable[..., Any], Setting] | None:
        """Return the compiled loop for a trial grasp, that of the grasps themselves; None where those run plain."""
        composition = composition_of(self.job.config, setting)
        # What maps may take is checked by steps, which would be compiled for that alone.
        config = self.job.config
        if config.transmission == "straight" or not self._worth(self.of_kinds[compiled_kinds(setting.kinds)]):
            return None
        try:
            loop = kernel.compiled(loop_of(composition, step))
        except NotCompilable:
            return None

        def guarded(*given: Any) -> Any:
            with _COMPILING, first_call():
                return loop(*given)

        return guarded, as_compiled(setting)

    def _slice(self, begin: int) -> list[Done]:
        """Run the slice that begins there."""
        scenes, seeds = self.scenes[begin : begin + SLICE], self.seeds[begin : begin + SLICE]
        found: dict[int, Done] = {}
        plain: list[int] = []
        for i, (scene, seed) in enumerate(zip(scenes, seeds, strict=True)):
            setting = self._setting(scene, seed)
            one = self._fast(setting)
            if one is None:
                plain.append(i)
            else:
                found[i] = one
        if plain:
            done = self._plain([scenes[i] for i in plain], [seeds[i] for i in plain])
            found.update(zip(plain, done, strict=True))
        return [found[i] for i in range(len(scenes))]

    def _fast(self, setting: Setting) -> Done | None:
        """Run one grasp compiled; None where it is to run plain."""
        kinds = composition_of(self.job.config, setting)
        if kinds not in self.fast:
            # Friction drawn anew may leave it piecewise linear in one trial and not in the next.
            self.fast[kinds] = any(fast for one, fast in self.fast.items() if one.kinds == kinds.kinds)
        if not self.fast[kinds]:
            return None
        loop = self.loops.get(kinds)
        if loop is None:
            # The first call compiles; meanwhile the others wait, for they would compile the same once more.
            with _COMPILING:
                try:
                    plain = loop_of(kinds, type(self.job.controller).step)
                    loop = kernel.compiled(plain)
                    with first_call(slp_vectorize=kinds.shape is not None):
                        one = grasp_compiled(self.job, setting, loop, self._storage())
                    self.loops[kinds] = entry_point(loop)
                    return one
                except NotCompilable as error:
                    self.fast[kinds] = False
                    self._slowly(str(error))
                    return None
        return grasp_compiled(self.job, setting, loop, self._storage())

    def _slowly(self, why: str) -> None:
        how = f"on {self.workers} cores" if self._apart() else "on one core"
        self.notes[f"these grasps run in plain Python {how}, about a hundred times slower: {why}"] = None

    def _apart(self) -> bool:
        """Return whether plain grasps are worth processes of their own."""
        plain = sum(n for kinds, n in self.counts.items() if not self.fast[kinds])
        return self.workers > 1 and plain >= WORTH_A_PROCESS * self.workers

    def _plain(self, scenes: Sequence[str], seeds: Sequence[int]) -> list[Done]:
        if self._apart() and not getattr(self.own, "alone", False):
            try:
                if not hasattr(self.own, "process"):
                    self.own.process = self.processes.enter_context(PlainProcess(self.job))
                return self.own.process.run(scenes, seeds)  # type: ignore[no-any-return]
            except NotHandedOver as error:
                self.own.alone = True
                self.notes[f"plain grasps run on one core: {error}"] = None
        return [plainly(self.job, scene, seed) for scene, seed in zip(scenes, seeds, strict=True)]

    def _storage(self) -> Storage:
        if not hasattr(self.own, "storage"):
            self.own.storage = Storage()
        return self.own.storage  # type: ignore[no-any-return]
