"""The compiled grasps of a batch in one thread."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from attrs import field, frozen

from graspsense_sim_gripper.run.batch.job import (
    FinishedGrasp,
    Job,
    Measure,
    ended_as,
    extracted_from,
    grasp_plain,
    started,
)
from graspsense_sim_gripper.run.batch.scenes import (
    Drawing,
    DrawMemory,
    Scenes,
    SelectedScene,
    draw_numbers,
    number_in,
)
from graspsense_sim_gripper.run.buffers import Storage, begin_images, longer
from graspsense_sim_gripper.run.compiled.loop_code import (
    NO_NOISE,
    CellNoise,
    CompiledLoop,
    CompiledLoops,
    LoopStart,
)
from graspsense_sim_gripper.run.compiled.padding import padded
from graspsense_sim_gripper.run.loop import Buffers, LoopEnd, before_failure
from graspsense_sim_gripper.run.model_report import GraspModel
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.run.term_failure import not_finite_in_tick
from graspsense_sim_gripper.scene.random_numbers import Word, key_of
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS


class CompiledStart(NamedTuple):
    """A compiled grasp before it begins."""

    start: LoopStart
    setup: Callable[[], GraspSetup]
    """Returns the same grasp as named tuples, which is needed if a term fails in it."""
    key: Word | None
    """That of its seed; None: its sensors are ideal."""
    terms: tuple[int, ...]
    """The places of the object's own terms."""
    model: GraspModel


@frozen(eq=False)
class CompiledGrasps:
    """Simulates compiled grasps one after the other."""

    scenes: Scenes
    loops: CompiledLoops
    drawing: Drawing = draw_numbers
    """What draws a grasp, compiled or not."""
    measure: Measure | None = None
    """The compiled form of `Job.extraction`; None: `Job.extract` is called with a trace."""
    storage: Storage = field(factory=Storage, init=False)
    _memory: dict[SelectedScene, DrawMemory] = field(factory=dict, init=False)

    def grasp(self, name: str, seed: int) -> FinishedGrasp:
        """Simulate a grasp of a scene. Raises NotCompilable, and otherwise as `Scenes.setup` does."""
        scene, number = self.scenes.find(name), number_in(name)
        loop, drawn = self.loops.loop_of(scene.composition), scene.drawn
        if scene not in self._memory:
            self._memory[scene] = drawn.memory()
        key = key_of(seed)
        start = drawn.drawn(self.drawing, key, number, self._memory[scene])
        prepared = CompiledStart(
            start=start,
            setup=partial(scene.setup, seed, number),
            key=key if drawn.has_cells else None,
            terms=drawn.terms,
            model=scene.model,
        )
        return grasp_compiled(self.scenes.job, loop, prepared, self.storage, self.measure)


def grasp_compiled(
    job: Job, loop: CompiledLoop, prepared: CompiledStart, storage: Storage, measure: Measure | None = None
) -> FinishedGrasp:
    """Simulate a grasp with the compiled loop of its composition; `measure`: as for `extracted_from`.

    Raises NotCompilable if the loop cannot be compiled.
    """
    try:
        (end, state, plant), buffers = _run(loop, prepared, storage.buffers, job.max_ticks)
    except LAW_ERRORS:
        # Compiled code does not say which term raised it.
        return grasp_plain(job, prepared.setup(), prepared.model)
    outcome, reason = ended_as(job, end)
    if end.failed == 1:
        setup = padded(prepared.setup())
        begin_images(buffers)
        last_plant = before_failure(loop, *started(job, setup), buffers, end.ticks)
        effort_n, plant = state().loop.tick.effort_n, lambda: last_plant
        reason = not_finite_in_tick(setup.kinds, setup.plant, last_plant, effort_n, setup.dt_s)
    storage.buffers = buffers
    extracted, kept = extracted_from(job, buffers, end, measure)
    return FinishedGrasp(
        outcome=outcome,
        reason=reason,
        end=plant,
        extracted=extracted,
        trace=kept,
        model=prepared.model,
        terms=prepared.terms,
    )


def _run(
    loop: CompiledLoop, prepared: CompiledStart, buffers: Buffers, max_ticks: int
) -> tuple[LoopEnd, Buffers]:
    """Run the loop to the end of a grasp, with longer buffers where these do not suffice."""
    start, key = prepared.start, prepared.key
    begin_images(buffers)
    end = loop.run_from(start, buffers, NO_NOISE if key is None else CellNoise(1, key))
    while end.ending.ended == 0 and end.ending.failed == 0 and end.ending.ticks < max_ticks:
        buffers = longer(buffers, key)
        start = start.after(end)
        end = loop.run_from(start, buffers)
    return end, buffers
