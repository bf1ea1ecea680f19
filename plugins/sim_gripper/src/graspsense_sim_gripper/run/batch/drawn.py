"""The grasps of a scene that compiled code draws, without a `GraspSetup` for each.

A grasp is an array of numbers, in which those that its seed decides are overwritten. The results are the same to the
bit as by `build.instantiate` (`test_a_drawn_grasp_is_that_of_the_seed`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense_sim_gripper.config import SimConfig
from graspsense_sim_gripper.plant.sensing import PadCells
from graspsense_sim_gripper.run.accuracy.model import Reduction
from graspsense_sim_gripper.run.build import check_fit, friction_spread
from graspsense_sim_gripper.run.compiled.compose import Composition
from graspsense_sim_gripper.run.compiled.drawing import (
    NO_NUMBER,
    DrawBuffers,
    Drawing,
    Places,
    SceneNumbers,
    draw_buffers,
)
from graspsense_sim_gripper.run.compiled.generator import LARGEST_SEED
from graspsense_sim_gripper.run.compiled.loop_code import (
    Arrays,
    LoopStart,
    LoopTypes,
    Numbers,
    loop_start,
)
from graspsense_sim_gripper.run.compiled.padding import PaddedLayout, composition_of, layout_of
from graspsense_sim_gripper.run.loop import GraspParams, SimulationState
from graspsense_sim_gripper.run.nested import appender, with_places
from graspsense_sim_gripper.run.problem import GraspSetup, Problem
from graspsense_sim_gripper.scene.instance import (
    N_COMMON_DRAWS,
    deepest_dent,
    draws_of_number,
    present_cells,
)
from graspsense_sim_gripper.scene.spec import PATCHES, NominalParams, ObjectSpec


class DrawMemory(NamedTuple):
    """Memory that drawing and simulating a grasp overwrite."""

    buffers: DrawBuffers
    arrays: Arrays
    """Those of a grasp, some of which are written to."""


class StartLayout(NamedTuple):
    """What the grasps of a composition have in common at their beginning."""

    types: LoopTypes
    at: Any
    """Parameters and state, in which each number is its place among all numbers."""
    cells: tuple[int, ...]
    """The places of the weights and offsets of the left and of the right cells among all arrays."""

    @classmethod
    def of(cls, params: GraspParams, state: SimulationState) -> StartLayout:
        """Return that of a grasp with these parameters and this first state."""
        # Other arrays in their stead are told apart, while both fingertips may share theirs.
        left, right = (PadCells(np.zeros(0), np.zeros(0)) for _ in range(2))
        arrays: list[NDArray[Any]] = []
        told_apart = params._replace(sensor=params.sensor._replace(left=left, right=right))
        appender(told_apart)(told_apart, [], arrays)

        def place(wanted: Any) -> int:
            return next(i for i, array in enumerate(arrays) if array is wanted)

        return cls(
            LoopTypes.of(params, state),
            with_places((params, state)),
            tuple(place(array) for array in (*left, *right)),
        )


@frozen(eq=False)
class DrawnScene:
    """What the grasps of a scene are drawn from."""

    config: SimConfig
    spec: ObjectSpec
    composition: Composition
    layout: PaddedLayout
    start: StartLayout
    numbers: Numbers
    """Those of the parameters and of the first state of a grasp; which a seed decides is arbitrary."""
    arrays: Arrays
    """Its arrays; which a seed decides are arbitrary."""
    scene: SceneNumbers
    places: Places

    @property
    def has_cells(self) -> bool:
        """Whether the sensors are pads."""
        return self.scene.has_cells == 1

    def memory(self) -> DrawMemory:
        """Return memory for drawing and simulating its grasps one after the other, in one thread."""
        buffers = draw_buffers(N_COMMON_DRAWS + self.scene.n_own + 1, len(self.places.params))
        arrays, (weights, left, right) = [*self.arrays], buffers.cells
        if self.has_cells:
            for place, array in zip(self.start.cells, (weights, left, weights, right), strict=True):
                arrays[place] = array
        return DrawMemory(buffers, tuple(arrays))

    def drawn(self, drawing: Drawing, seed: int, number: int | None, memory: DrawMemory) -> LoopStart:
        """Return the grasp with this seed, from 0 to LARGEST_SEED; `number`: that of a particular instance.

        Its arrays are those of `memory`, until the next grasp is drawn to it. Raises ConfigError as `check_fit` does.
        """
        numbers, spec, places, (buffers, arrays) = self.numbers.copy(), self.spec, self.places, memory
        of_number = NO_NUMBER if number is None else np.array(draws_of_number(spec, number))
        drawing(self.scene, places, seed, of_number, buffers, numbers)
        if spec.dents and self.scene.varies == 1:
            numbers[places.width_m] -= deepest_dent(spec, buffers.params.tolist())
        if spec.file:
            check_fit(self.config, spec, float(numbers[places.width_m]), float(numbers[places.offset_m]))
        return LoopStart(self.start.types, numbers, arrays)


class DrawnInstances(NamedTuple):
    """What grasps are drawn from, of any instances of a scene or of a particular one."""

    scene: DrawnScene
    number: int | None
    """That of the instance."""


def can_be_drawn(seed: int) -> bool:
    """Return whether compiled code draws grasps with this seed."""
    return 0 <= seed <= LARGEST_SEED


def drawn_scene(
    problem: Problem,
    reduction: Reduction | None,
    example: GraspSetup,
    begun: tuple[GraspParams, SimulationState],
    layouts: dict[Composition, StartLayout],
) -> DrawnScene | None:
    """Return what the grasps of a scene are drawn from; None if each of them needs a `GraspSetup`.

    `example`: one of them; `begun`: its parameters and its first state, padded. `layouts`: those that are known, to
    which that of this scene is added.
    """
    spec, sensor = problem.spec, example.sensor
    if spec is None or reduction is None or example.has_palm:
        return None
    layout, config = layout_of(example), problem.config
    composition = composition_of(example)
    if composition not in layouts:
        layouts[composition] = StartLayout.of(*begun)
    known = layouts[composition]
    start, places = loop_start(*begun, known.types), _places(known.at, layout, spec)
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
    return DrawnScene(
        config=config,
        spec=spec,
        composition=composition,
        layout=layout,
        start=known,
        numbers=start.numbers,
        arrays=start.arrays,
        scene=scene,
        places=places,
    )


def _places(at: Any, layout: PaddedLayout, spec: ObjectSpec) -> Places:
    """Return where the numbers are that a seed decides; `at`: parameters and state with the place of each number."""
    params, state = at
    friction, model = params.plant.drive.friction, params.plant.object
    of_params: list[int] = []
    for position in layout.places:
        of_params += model.terms[position].params
    return Places(
        coulomb_n=friction.coulomb_n,
        breakaway_n=friction.breakaway_n,
        width_m=model.width_m,
        offset_m=state.plant.contact.offset_m,
        share=params.sensor.share,
        image_phase_s=params.sensor.clock.phase_s,
        params=np.array(of_params, np.int64),
    )
