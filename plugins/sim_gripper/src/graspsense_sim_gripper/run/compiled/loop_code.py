"""The compiled loop of a grasp. It begins with an array of numbers, and its end is one.

The interpreter takes a tenth of the time of a grasp for the named tuples of a state, and a batch reads few of them.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Callable
from functools import cached_property, lru_cache
from typing import Any, Final, NamedTuple

import numpy as np
from attrs import frozen
from numpy.typing import NDArray

from graspsense.simulator_api import NotCompilable, bind, entry_point, is_on_disk
from graspsense_sim_gripper.plant.object_model import unbound
from graspsense_sim_gripper.plant.sensing import PadBuffers, PadCells
from graspsense_sim_gripper.run.binding import bind_reachable
from graspsense_sim_gripper.run.compiled.compose import Composition, grasp_loop
from graspsense_sim_gripper.run.compiled.jit import COMPILING, OPTIONS, compile_part, generating
from graspsense_sim_gripper.run.drawing import draw_image_noise
from graspsense_sim_gripper.run.loop import Buffers, Ending, GraspParams, LoopEnd, SimulationState, ending
from graspsense_sim_gripper.run.nested import (
    Stored,
    TupleType,
    append,
    count_numbers,
    structure,
    with_places,
)
from graspsense_sim_gripper.run.problem import ControllerStep
from graspsense_sim_gripper.scene.random_numbers import IN_COMPILED_CODE, Word, key_of

FIRST_IMAGES: Final = 80
IMAGES_AT_ONCE: Final = 16
"""Number of images whose noise is drawn before a grasp, and for how many more each time that these are used up."""

Numbers = NDArray[np.float64]
Arrays = tuple[NDArray[Any], ...]


grasp: Callable[[GraspParams, SimulationState, Buffers], SimulationState] = unbound
tuples_of: Callable[[TupleType, Any, Any], Any] = unbound
store_numbers: Callable[[Any, Any], None] = unbound


class CellNoise(NamedTuple):
    """The noise of the cells of a grasp."""

    is_drawn: int
    """1: it is drawn to the buffers where the grasp comes to it; 0: it is in them, or there is none."""
    key: Word
    """The key of the seed."""


NO_NOISE: Final = CellNoise(0, key_of(0))


def stored_grasp(
    pattern: TupleType, start: Any, arrays: Any, buffers: Buffers, noise: CellNoise, end: Any
) -> Ending:
    """Run `grasp` from the numbers and arrays of its parameters and its state, which have the types of `pattern`.

    Write the numbers of the state at its end to `end`, and return those that all callers read. The noise of the cells
    is drawn where the grasp comes to it.
    """
    params, state = tuples_of(pattern, start, arrays)
    pads, image_times, columns, phases = buffers
    left_zero, right_zero, of_images, images = pads
    most, n = len(images), FIRST_IMAGES if noise.is_drawn == 1 else len(images)
    drawn, going = 0, True
    while going:
        n = min(n, most)
        if noise.is_drawn == 1:
            draw_image_noise(noise.key, drawn, n, of_images)
        if state.sensor.cells.images == 0:
            # The loop reads it as the image before the first one.
            images[n - 1] = math.nan
        part = PadBuffers(left_zero, right_zero, of_images, images[:n])
        state = grasp(params, state, Buffers(part, image_times, columns, phases))
        done = ending(state)
        going = done.ended == 0 and done.failed == 0 and done.images == n and n < most
        drawn, n = n, n + IMAGES_AT_ONCE
    store_numbers(end, state)
    return done


class LoopStart(NamedTuple):
    """The parameters of a grasp and a state of it, in the form that a compiled loop takes."""

    types: LoopTypes
    numbers: Numbers
    """Those of the parameters, then those of the state."""
    arrays: Arrays

    def after(self, end: LoopEnd) -> LoopStart:
        """Return the same grasp in the state in which a compiled loop ended."""
        state = end.state
        assert isinstance(state, Stored)
        of_params = self.numbers[: len(self.numbers) - len(state.numbers)]
        return LoopStart(self.types, np.concatenate([of_params, state.numbers]), self.arrays)


@frozen(eq=False, slots=False)
class LoopTypes:
    """The types of the parameters and the states of the grasps of a compiled loop."""

    begun: TupleType
    """Parameters and state."""
    state: TupleType
    plant: TupleType
    before_plant: int
    """Number of numbers of the state before those of the plant."""

    @classmethod
    def made_of(cls, params: GraspParams, state: SimulationState) -> LoopTypes:
        """Return the types of these parameters and of this state."""
        begun = params, state
        key = structure(begun)
        known = _TYPES.get(key)
        if known is None:
            if len(_TYPES) >= MOST_TYPES:
                _TYPES.clear()
            own = TupleType.made_of(state), TupleType.made_of(state.plant)
            known = _TYPES[key] = cls(TupleType.made_of(begun), *own, count_numbers(state.loop))
        return known

    @cached_property
    def places(self) -> Any:
        """Parameters and state, in which each number is its place among all numbers. It takes a millisecond."""
        return with_places(self.begun.pattern)

    @cached_property
    def cells(self) -> tuple[int, ...]:
        """The places of the weights and offsets of the left and of the right cells among all arrays."""
        params, _ = self.begun.pattern
        # Other arrays in their stead are told apart, while both fingertips may share theirs.
        left, right = (PadCells(np.zeros(0), np.zeros(0)) for _ in range(2))
        arrays: list[NDArray[Any]] = []
        append(params._replace(sensor=params.sensor._replace(left=left, right=right)), [], arrays)
        places = {id(array): place for place, array in enumerate(arrays)}
        return tuple(places[id(array)] for array in (*left, *right))


MOST_TYPES: Final = 64
_TYPES: Final[dict[Any, LoopTypes]] = {}
"""Those that are known, by the structure of parameters and state: making them takes a millisecond."""


def loop_start(params: GraspParams, state: SimulationState, types: LoopTypes | None = None) -> LoopStart:
    """Return a state of a grasp in the form that a compiled loop takes; `types`: its types, if they are known.

    Raises NotCompilable if something in it is neither a number nor an array, TypeError if it is not of these types.
    """
    numbers, arrays, types = array("d"), list[NDArray[Any]](), types or LoopTypes.made_of(params, state)
    try:
        append((params, state), numbers, arrays)
    except TypeError as error:
        raise NotCompilable(f"the parameters or the state of a grasp are not all numbers: {error}") from error
    if len(numbers) != types.begun.count:
        raise TypeError(f"a grasp with {len(numbers)} numbers in a loop for grasps with {types.begun.count}")
    return LoopStart(types, np.frombuffer(numbers), tuple(arrays))


class CompiledLoop:
    """The compiled loop of a composition for a controller. Its first grasp decides which numbers are integers."""

    def __init__(self, compiled: Callable[..., Ending]) -> None:
        """Take the function that `compile_function` returned; its first call makes machine code."""
        self._compiled = compiled
        self._machine_code: Callable[..., Ending] | None = None
        self._types: LoopTypes | None = None

    def run(self, params: GraspParams, progress: SimulationState, buffers: Buffers) -> LoopEnd:
        """Run the grasp from a state to its end, as `loop.grasp` does. Raises NotCompilable if numba refuses."""
        return self.run_from(loop_start(params, progress, self._types), buffers)

    def run_from(self, start: LoopStart, buffers: Buffers, noise: CellNoise | None = None) -> LoopEnd:
        """Run the grasp from its start to its end; `noise` None: it is in the buffers.

        Raises NotCompilable if numba refuses.
        """
        types, state = start.types, np.empty(start.types.state.count)
        arguments = types.begun, start.numbers, start.arrays, buffers, noise or NO_NOISE, state
        if self._machine_code is not None:
            end = self._machine_code(*arguments)
        else:
            with generating():
                end = self._compiled(*arguments)
            self._types, self._machine_code = types, entry_point(self._compiled)
        plant = state[types.before_plant : types.before_plant + types.plant.count]
        return LoopEnd(end, Stored(types.state, state), Stored(types.plant, plant))

    def __call__(self, params: GraspParams, progress: SimulationState, buffers: Buffers) -> SimulationState:
        """Return the state at the end of what `run` runs."""
        state: SimulationState = self.run(params, progress, buffers).state()
        return state


class CompiledLoops:
    """The compiled loops of a batch.

    Another batch, whose controller may be set to a whole number where this one is not, takes loops of its own.
    """

    def __init__(self, step: ControllerStep) -> None:
        """Take the step of the controller."""
        self._step = step
        self._loops: dict[Composition, CompiledLoop] = {}

    def loop_of(self, composition: Composition) -> CompiledLoop:
        """Return the loop of a composition. Raises NotCompilable."""
        if composition not in self._loops:
            # Threads wait for each other, so that the functions of a loop are not found twice.
            with COMPILING:
                if composition not in self._loops:
                    self._loops[composition] = CompiledLoop(_compiled(composition, self._step))
        return self._loops[composition]


def is_kept(composition: Composition, step: ControllerStep) -> bool:
    """Return whether an earlier process has kept the compiled loop of a composition on disk."""
    try:
        return is_on_disk(_composed(composition, step), OPTIONS)
    except NotCompilable:
        return False


@lru_cache(maxsize=64)
def _compiled(composition: Composition, step: ControllerStep) -> Callable[..., Ending]:
    """Return `stored_grasp` of a composition for a controller with this step, compiled. Raises NotCompilable."""
    return compile_part(_composed(composition, step))


@lru_cache(maxsize=64)
def _composed(composition: Composition, step: ControllerStep) -> Callable[..., Ending]:
    """Return what `_compiled` compiles. Raises NotCompilable."""
    try:
        from graspsense_sim_gripper.run.compiled.nested_numbers import store_numbers, tuples_of
    except ImportError as error:
        raise NotCompilable(f'numba is not installed: pip install "{OPTIONS.install}"') from error
    parts = {
        "grasp": grasp_loop(composition, step, interpreted=False),
        "tuples_of": tuples_of,
        "store_numbers": store_numbers,
    }
    return bind_reachable(bind(stored_grasp, **parts), IN_COMPILED_CODE)
