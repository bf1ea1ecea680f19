"""The grasps of a scene that compiled code draws, without a `GraspSetup` for each.

A grasp is an array of numbers, in which those that its seed decides are overwritten. The results are the same to the
bit as by `build.instantiate`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from attrs import field, frozen

from graspsense.plugin_api import ended_by_itself
from graspsense_sim_gripper.batch.job import (
    FinishedGrasp,
    Job,
    Measure,
    Storage,
    begin_images,
    measured,
    with_more_images,
)
from graspsense_sim_gripper.build import check_fit, friction_spread, present_cells
from graspsense_sim_gripper.compiled.compose import Composition
from graspsense_sim_gripper.compiled.drawing import (
    NO_NUMBER,
    DrawBuffers,
    Drawing,
    Places,
    SceneNumbers,
    draw_buffers,
)
from graspsense_sim_gripper.compiled.generator import LARGEST_SEED
from graspsense_sim_gripper.compiled.loop_code import (
    Arrays,
    CompiledLoop,
    LoopStart,
    LoopTypes,
    Numbers,
    loop_start,
)
from graspsense_sim_gripper.compiled.padding import PaddedLayout, composition_of, layout_of
from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.loop import Buffers, Ending, GraspParams, SimulationState
from graspsense_sim_gripper.nested import with_places
from graspsense_sim_gripper.objects.instance import N_COMMON_DRAWS, deepest_dent, draws_of_number
from graspsense_sim_gripper.objects.spec import PATCHES, NominalParams, ObjectSpec
from graspsense_sim_gripper.problem import GraspSetup, Problem
from graspsense_sim_gripper.reduction.model import DROPPED, KEPT, Reduction
from graspsense_sim_gripper.terms.term import LAW_ERRORS


@frozen(eq=False)
class DrawnScene:
    """What the grasps of a scene are drawn from."""

    config: SimConfig
    spec: ObjectSpec
    composition: Composition
    layout: PaddedLayout
    types: LoopTypes
    numbers: Numbers
    """Those of the parameters and of the first state of a grasp; which a seed decides is arbitrary."""
    arrays: Arrays
    """The arrays of a grasp with ideal sensors."""
    scene: SceneNumbers
    places: Places

    @property
    def has_cells(self) -> bool:
        """Whether the sensors are pads."""
        return self.scene.has_cells == 1

    def drawn(self, drawing: Drawing, seed: int, number: int | None, buffers: DrawBuffers) -> LoopStart:
        """Return the grasp with this seed, from 0 to LARGEST_SEED; `number`: that of a particular instance.

        Its cells are those of `buffers`, until the next grasp is drawn to them. Raises ConfigError as `check_fit` does.
        """
        numbers, spec, places = self.numbers.copy(), self.spec, self.places
        of_number = NO_NUMBER if number is None else np.array(draws_of_number(spec, number))
        drawing(self.scene, places, seed, of_number, buffers, numbers)
        if spec.dents and self.scene.varies == 1:
            numbers[places.width_m] -= deepest_dent(spec, buffers.params.tolist())
        if spec.file:
            check_fit(self.config, spec, float(numbers[places.width_m]), float(numbers[places.offset_m]))
        cells = buffers.cells
        pads = cells.weights, cells.left, cells.weights, cells.right
        return LoopStart(self.types, numbers, pads if self.has_cells else self.arrays)

    def buffers(self) -> DrawBuffers:
        """Return the memory for drawing its grasps."""
        return draw_buffers(N_COMMON_DRAWS + self.scene.n_own + 1, len(self.places.params))


class DrawnInstances(NamedTuple):
    """What grasps are drawn from, of any instances of a scene or of a particular one."""

    scene: DrawnScene
    number: int | None
    """That of the instance."""


@frozen(eq=False)
class DrawnGrasps:
    """Simulates grasps that compiled code draws, in one thread."""

    job: Job
    drawing: Drawing
    measure: Measure | None
    """The compiled form of `Job.extraction`; None: nothing is extracted."""
    storage: Storage
    _buffers: dict[int, DrawBuffers] = field(factory=dict, init=False)
    """Memory for drawing, by the identity of the scene."""

    def grasp(self, instances: DrawnInstances, seed: int, loop: CompiledLoop) -> FinishedGrasp | None:
        """Simulate a grasp; None if a term fails or it takes long, so that it has to be simulated from its setup.

        Raises ConfigError as `DrawnScene.drawn` does.
        """
        scene, number = instances
        if id(scene) not in self._buffers:
            self._buffers[id(scene)] = scene.buffers()
        drawn = self._buffers[id(scene)]
        start = scene.drawn(self.drawing, seed, number, drawn)
        noise = self.drawing.noise(drawn) if scene.has_cells else None
        buffers = self.storage.buffers
        begin_images(buffers, noise)
        try:
            end = loop.run_from(start, buffers)
            while noise is not None and _needs_images(end.ending, buffers):
                buffers, start = with_more_images(buffers, noise), start.after(end)
                end = loop.run_from(start, buffers)
        except LAW_ERRORS:
            return None
        if end.ending.failed == 1 or end.ending.ended == 0:
            return None
        extracted = None
        if self.measure is not None:
            try:
                extracted = measured(self.job, self.measure, buffers, end.ending)
            except Exception:
                # Compiled code does not say where an exception comes from. `Job.extract` does.
                return None
        outcome, reason = ended_by_itself(end.ending.stopped, end.ending.outcome)
        return FinishedGrasp(
            outcome=outcome, reason=reason, end=end.plant, layout=scene.layout, extracted=extracted, kept=None
        )


def _needs_images(ending: Ending, buffers: Buffers) -> bool:
    """Return whether a grasp has not ended, but has filled the buffers of images."""
    return ending.ended == 0 and ending.failed == 0 and ending.images == len(buffers.pads.images)


def can_be_drawn(seed: int) -> bool:
    """Return whether compiled code draws grasps with this seed."""
    return 0 <= seed <= LARGEST_SEED


def drawn_scene(
    problem: Problem,
    reduction: Reduction | None,
    example: GraspSetup,
    params: GraspParams,
    state: SimulationState,
) -> DrawnScene | None:
    """Return what the grasps of a scene are drawn from; None if each of them needs a `GraspSetup`.

    `example`: one of them; `params` and `state`: its parameters and its first state, padded.
    """
    spec, plant, sensor = problem.spec, example.plant, example.sensor
    # With a straight linkage the draws decide how a grasp is discretised; limits of terms depend on the instance.
    if spec is None or reduction is None or example.has_palm or plant.drive.link.finger_m == 0.0:
        return None
    if not set(reduction.treatment[:-1]) <= {KEPT, DROPPED}:
        return None
    layout, config = layout_of(example), problem.config
    at = with_places((params, state))
    start, places = loop_start(params, state), _places(at, layout)
    if sensor.ideal == 0:
        start.numbers[places.image_phase_s] = sensor.clock.period_s
    nominal = spec.nominal_params
    scene = SceneNumbers(
        varies=1 if config.spread else 0,
        has_cells=1 - sensor.ideal,
        nominal=NominalParams(
            np.array(nominal.value), np.array(nominal.is_stiffness, np.int64), np.array(nominal.spread)
        ),
        spread=spec.spread,
        n_own=spec.n_own_spreads,
        friction=friction_spread(config),
        patch=PATCHES.index(spec.patch),
        present=present_cells(config.pad_cells),
    )
    composition = composition_of(config, example)
    return DrawnScene(
        config, spec, composition, layout, start.types, start.numbers, start.arrays, scene, places
    )


def _places(at: Any, layout: PaddedLayout) -> Places:
    """Return where the numbers are that a seed decides; `at`: parameters and state with the place of each number."""
    params, state = at
    friction, model = params.plant.drive.friction, params.plant.object
    of_params = [place for position, _ in layout.places[1:] for place in model.terms[position].params]
    return Places(
        coulomb_n=friction.coulomb_n,
        breakaway_n=friction.breakaway_n,
        width_m=model.width_m,
        offset_m=state.plant.contact.offset_m,
        share=params.sensor.share,
        image_phase_s=params.sensor.clock.phase_s,
        params=np.array(of_params, np.int64),
    )
