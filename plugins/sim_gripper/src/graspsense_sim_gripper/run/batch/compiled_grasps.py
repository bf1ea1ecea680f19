"""The compiled grasps of a batch in one thread: drawn in compiled code where that is possible."""

from __future__ import annotations

from collections.abc import Callable
from importlib.util import find_spec

from attrs import field, frozen

from graspsense.simulator_api import ended_by_itself
from graspsense_sim_gripper.run.batch.drawn import (
    Drawing,
    DrawMemory,
    DrawnInstances,
    DrawnScene,
    compiled_drawing,
)
from graspsense_sim_gripper.run.batch.job import (
    EndedGrasp,
    FinishedGrasp,
    Job,
    Measure,
    Storage,
    begin_images,
    grasp_compiled,
    result_of,
    with_more_images,
)
from graspsense_sim_gripper.run.batch.scenes import Scenes
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.loop_code import CellNoise, CompiledLoop, CompiledLoops
from graspsense_sim_gripper.run.compiled.padding import composition_of
from graspsense_sim_gripper.run.loop import Buffers, Ending
from graspsense_sim_gripper.scene.random_numbers import key_of
from graspsense_sim_gripper.scene.terms.term import LAW_ERRORS


def _every(composition: Composition) -> bool:
    return True


@frozen(eq=False)
class CompiledGrasps:
    """Simulates compiled grasps one after the other."""

    scenes: Scenes
    loops: CompiledLoops
    measure: Measure | None = None
    """The compiled form of `Job.extraction`; None: `Job.extract` is called with a trace."""
    is_compiled: Callable[[Composition], bool] = _every
    """Whether the loop of a composition is compiled."""
    storage: Storage = field(factory=Storage, init=False)
    _drawing: Drawing | None = field(init=False)
    """None if nothing can be compiled."""
    _memory: dict[DrawnScene, DrawMemory] = field(factory=dict, init=False)

    @_drawing.default
    def _compiled_drawing(self) -> Drawing | None:
        return None if find_spec("numba") is None else compiled_drawing()

    @property
    def job(self) -> Job:
        """The job of the scenes."""
        return self.scenes.job

    def grasp(self, scene: str, seed: int) -> FinishedGrasp | None:
        """Simulate a grasp of a scene; None if its loop is not compiled.

        Raises NotCompilable if it cannot be compiled, and otherwise as `Scenes.setup` does.
        """
        instances = self.scenes.drawn(scene)
        if instances is not None and self._drawing is not None:
            composition = instances.scene.composition
            if not self.is_compiled(composition):
                return None
            done = self._drawn(self._drawing, instances, seed, self.loops.loop_of(composition))
            if done is not None:
                return done
        setup = self.scenes.setup(scene, seed)
        composition = composition_of(setup)
        if not self.is_compiled(composition):
            return None
        return grasp_compiled(self.job, setup, self.loops.loop_of(composition), self.storage, self.measure)

    def _drawn(
        self, drawing: Drawing, instances: DrawnInstances, seed: int, loop: CompiledLoop
    ) -> FinishedGrasp | None:
        """Simulate a grasp; None if it has to be simulated from its setup.

        That is so if a term fails in it, or if it does not end within the ticks that the buffers hold.
        """
        scene, number = instances
        if scene not in self._memory:
            self._memory[scene] = scene.memory()
        memory, buffers = self._memory[scene], self.storage.buffers
        key = key_of(seed)
        start = scene.drawn(drawing, key, number, memory)
        begin_images(buffers)
        try:
            end = loop.run_from(start, buffers, CellNoise(int(scene.has_cells), key))
            while scene.has_cells and _needs_images(end.ending, buffers):
                buffers = with_more_images(buffers, key)
                start = start.after(end)
                end = loop.run_from(start, buffers)
        except LAW_ERRORS:
            return None
        if end.ending.failed == 1 or end.ending.ended == 0:
            return None
        outcome, reason = ended_by_itself(end.ending.stopped, end.ending.outcome)
        done = EndedGrasp(outcome, reason, end.plant, scene.layout, end.ending)
        return result_of(self.job, done, buffers, self.storage, self.measure)


def _needs_images(ending: Ending, buffers: Buffers) -> bool:
    """Return whether a grasp has not ended, but has filled the buffers of images."""
    return ending.ended == 0 and ending.failed == 0 and ending.images == len(buffers.pads.images)
