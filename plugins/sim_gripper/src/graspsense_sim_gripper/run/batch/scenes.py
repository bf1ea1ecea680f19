"""The scenes of a batch, each with its steps, and their grasps, drawn without a `GraspSetup` for each.

A grasp that starts a compiled loop is an array of numbers, in which those that its seed decides are overwritten. The
results are the same to the bit as by `build.instantiate` (`test_a_drawn_grasp_is_that_of_the_seed`), drawn in compiled
code or in the interpreter.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import define, evolve, field, frozen
from numpy.typing import NDArray

from graspsense.simulator_api import CompileOptions, compile_function, entry_point, is_on_disk
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.run.accuracy.chosen_steps import ChosenSteps
from graspsense_sim_gripper.run.accuracy.select import select
from graspsense_sim_gripper.run.batch.job import Job, started
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.build import Problem, build, check_fit, instantiate
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.jit import generating
from graspsense_sim_gripper.run.compiled.loop_code import (
    Arrays,
    LoopStart,
    LoopTypes,
    Numbers,
    loop_start,
)
from graspsense_sim_gripper.run.compiled.padding import composition_of, padded, places_of
from graspsense_sim_gripper.run.drawing import (
    NO_NUMBER,
    DrawBuffers,
    SceneNumbers,
    draw_buffers,
    draw_grasp,
    scene_numbers,
)
from graspsense_sim_gripper.run.loop import GraspParams, SimulationState
from graspsense_sim_gripper.run.model_report import GraspModel
from graspsense_sim_gripper.run.problem import GraspSetup
from graspsense_sim_gripper.run.sampled_loop import instability
from graspsense_sim_gripper.scene.instance import deepest_dent, draws_of_number
from graspsense_sim_gripper.scene.library import split_number
from graspsense_sim_gripper.scene.random_numbers import IN_COMPILED_CODE, Word, key_of
from graspsense_sim_gripper.scene.spec import NominalParams, ObjectSpec


class Places(NamedTuple):
    """Where the numbers that a seed decides are among those of a grasp."""

    coulomb_n: int
    breakaway_n: int
    width_m: int
    offset_m: int
    share: int
    image_phase_s: int
    params: NDArray[np.int64]
    """Those of the terms, in the order of `NominalParams`."""


Drawing = Callable[[SceneNumbers, Places, Word, Any, DrawBuffers, Any], None]
"""`draw_numbers`, compiled or not."""


def draw_numbers(
    scene: SceneNumbers, places: Places, key: Word, of_number: Any, buffers: DrawBuffers, numbers: Any
) -> None:
    """Draw a grasp of the scene as `draw_grasp` does, and write it to its places in `numbers`."""
    drawn = draw_grasp(scene, key, of_number, buffers)
    numbers[places.coulomb_n], numbers[places.breakaway_n] = drawn.coulomb_n, drawn.breakaway_n
    numbers[places.width_m], numbers[places.offset_m] = drawn.placement.width_m, drawn.placement.offset_m
    for i in range(len(places.params)):
        numbers[places.params[i]] = buffers.params[i]
    if scene.period_s > 0.0:
        numbers[places.share], numbers[places.image_phase_s] = drawn.placement.share, drawn.image_phase_s


_OPTIONS: Final = CompileOptions(
    # Drawing takes less time than getting the lock of the interpreter back from another thread.
    releases_lock=False
)


def is_drawing_kept() -> bool:
    """Return whether an earlier process has kept the machine code of `draw_numbers` on disk."""
    return is_on_disk(_drawing_to_compile(), _OPTIONS)


@cache
def compiled_drawing() -> Drawing:
    """Return `draw_numbers` in compiled code. Raises NotCompilable."""
    none, no_places = np.zeros(0), np.zeros(0, np.int64)
    scene = _with_arrays(scene_numbers(SimConfig(), None))
    compiled = compile_function(_drawing_to_compile(), _OPTIONS)
    with generating():
        compiled(
            scene,
            Places(
                coulomb_n=0, breakaway_n=0, width_m=0, offset_m=0, share=0, image_phase_s=0, params=no_places
            ),
            key_of(0),
            none,
            _array_buffers(scene),
            np.zeros(1),
        )
    return entry_point(compiled)


@cache
def _drawing_to_compile() -> Drawing:
    return bind_reachable(draw_numbers, IN_COMPILED_CODE)


def _with_arrays(scene: SceneNumbers) -> SceneNumbers:
    """Return the numbers of a scene in arrays, as compiled code takes them."""
    value, is_stiffness, spread = scene.nominal
    return scene._replace(
        nominal=NominalParams(
            np.array(value, float), np.array(is_stiffness, np.int64), np.array(spread, float)
        )
    )


def _array_buffers(scene: SceneNumbers) -> DrawBuffers:
    draws, params, cells = draw_buffers(scene)
    return DrawBuffers(np.array(draws), np.array(params, float), cells)


class DrawMemory(NamedTuple):
    """Memory that drawing and simulating a grasp overwrite."""

    buffers: DrawBuffers
    arrays: Arrays
    """Those of a grasp, some of which are written to."""


@frozen(eq=False)
class DrawnScene:
    """What the grasps of a scene are drawn from."""

    config: SimConfig
    spec: ObjectSpec | None
    terms: tuple[int, ...]
    """The places of the object's own terms."""
    types: LoopTypes
    numbers: Numbers
    """Those of the parameters and of the first state of a grasp; which a seed decides is arbitrary."""
    arrays: Arrays
    """Its arrays; which a seed decides are arbitrary."""
    scene: SceneNumbers
    places: Places

    @property
    def has_cells(self) -> bool:
        """Whether the sensors are pads."""
        return self.scene.period_s > 0.0

    def memory(self) -> DrawMemory:
        """Return memory for drawing and simulating its grasps one after the other, in one thread."""
        buffers = _array_buffers(self.scene)
        arrays, (weights, left, right) = [*self.arrays], buffers.cells
        if self.has_cells:
            for place, array in zip(self.types.cells, (weights, left, weights, right), strict=True):
                arrays[place] = array
        return DrawMemory(buffers, tuple(arrays))

    def drawn(self, drawing: Drawing, key: Word, number: int | None, memory: DrawMemory) -> LoopStart:
        """Return the grasp with the seed of this key; `number`: that of a particular instance.

        Its arrays are those of `memory`, until the next grasp is drawn to it. Raises ConfigError as `check_fit` does.
        """
        numbers, spec, places, (buffers, arrays) = self.numbers.copy(), self.spec, self.places, memory
        of_number = NO_NUMBER
        if number is not None and spec is not None:
            of_number = np.array(draws_of_number(spec, number))
        drawing(self.scene, places, key, of_number, buffers, numbers)
        if spec is not None and spec.dents:
            numbers[places.width_m] -= deepest_dent(spec, buffers.params.tolist())
        if spec is not None and spec.file:
            check_fit(self.config, spec, float(numbers[places.width_m]), float(numbers[places.offset_m]))
        return LoopStart(self.types, numbers, arrays)


def drawn_scene(
    problem: Problem, example: GraspSetup, begun: tuple[GraspParams, SimulationState]
) -> DrawnScene:
    """Return what the grasps of a scene are drawn from.

    `example`: one of them; `begun`: its parameters and its first state, padded.
    """
    terms, start = places_of(example.kinds), loop_start(*begun)
    return DrawnScene(
        config=problem.config,
        spec=problem.spec,
        terms=terms,
        types=start.types,
        numbers=start.numbers,
        arrays=start.arrays,
        scene=_with_arrays(scene_numbers(problem.config, problem.spec)),
        places=_places(start.types.places, terms),
    )


def _places(known: Any, terms: Sequence[int]) -> Places:
    """Return where the numbers are that a seed decides.

    `known`: parameters and state with the place of each number; `terms`: the places of the object's own terms.
    """
    params, state = known
    friction, model = params.plant.drive.friction, params.plant.object
    of_params: list[int] = []
    for place in terms:
        of_params += model.terms[place].params
    return Places(
        coulomb_n=friction.coulomb_n,
        breakaway_n=friction.breakaway_n,
        width_m=model.width_m,
        offset_m=state.plant.contact.offset_m,
        share=params.sensor.share,
        image_phase_s=params.sensor.clock.phase_s,
        params=np.array(of_params, np.int64),
    )


@define(eq=False)
class SelectedScene:
    """A scene of a job with its steps, which all seeds share. The instances with a number are one scene."""

    job: Job
    problem: Problem
    chosen: ChosenSteps | None
    """None: there is no object."""

    def setup(self, seed: int, number: int | None) -> GraspSetup:
        """Return the grasp with this seed; `number`: that of a particular instance. Raises as `instantiate` does."""
        problem = self.problem
        if problem.number != number:
            problem = evolve(problem, number=number)
        return instantiate(problem, self.chosen, seed)

    @cached_property
    def example(self) -> GraspSetup:
        """Any of its grasps, for what all of them have in common."""
        return instantiate(self.problem, self.chosen, None)

    @cached_property
    def composition(self) -> Composition:
        """That of its compiled grasps."""
        return composition_of(self.example)

    @cached_property
    def drawn(self) -> DrawnScene:
        """What its compiled grasps are drawn from."""
        return drawn_scene(self.problem, self.example, started(self.job, padded(self.example)))

    @cached_property
    def model(self) -> GraspModel:
        """The model of its object, for the reports of its grasps."""
        if self.problem.spec is None or self.chosen is None:
            return GraspModel((), None, "")
        unstable = instability(self.example, self.job.grasp_controller, self.chosen)
        return GraspModel(self.problem.spec.kinds, self.chosen, unstable)


@define(eq=False)
class Scenes:
    """The scenes of a job."""

    job: Job
    selected: Mapping[tuple[str, bool], ChosenSteps | None] = field(factory=dict)
    """Models that were selected elsewhere, by `scene_key`."""
    _scenes: dict[tuple[str, bool], SelectedScene] = field(factory=dict, init=False)
    """By `scene_key`."""

    def add(self, name: str, *, compiled: bool = False) -> SelectedScene:
        """Select the model of a scene. `compiled`: run the trial grasps compiled, not in the interpreter.

        Raises UnknownName and ConfigError as `build` and `select` do.
        """
        job, key = self.job, scene_key(name)
        chosen = self.selected.get(key)
        problem = build(job.config, name)
        if problem.spec is not None and chosen is None:
            chosen = select(problem, job.grasp_controller, compiled=compiled)
        self._scenes[key] = SelectedScene(job, problem, chosen)
        return self._scenes[key]

    def find(self, name: str) -> SelectedScene:
        """Return a scene. Its model is selected if it was not added before. Raises as `add` does."""
        return self._scenes.get(scene_key(name)) or self.add(name)

    def setup(self, name: str, seed: int) -> GraspSetup:
        """Return the grasp of a scene with this seed. Raises as `add` and `instantiate` do."""
        return self.find(name).setup(seed, number_in(name))

    def models(self) -> dict[tuple[str, bool], ChosenSteps | None]:
        """Return the models of the scenes that were added, by `scene_key`."""
        return {key: scene.chosen for key, scene in self._scenes.items()}


@lru_cache(maxsize=4096)
def scene_key(name: str) -> tuple[str, bool]:
    """Return the key of a scene's model: the name without the number of an instance, and whether there is a number."""
    return split_number(name)[0], number_in(name) is not None


@lru_cache(maxsize=4096)
def number_in(name: str) -> int | None:
    """Return the number of an instance that the name of a scene ends with; None if there is none."""
    return split_number(name)[1]
