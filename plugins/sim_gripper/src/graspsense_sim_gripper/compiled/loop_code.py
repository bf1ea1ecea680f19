"""The compiled loop of a grasp. The state at its end is an array of numbers; named tuples are made of it when read.

The interpreter takes a tenth of the time of a grasp for the named tuples of a state, and a batch reads few of them.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from graspsense.plugin_api import NotCompilable, bind, entry_point
from graspsense_sim_gripper.compiled.compose import Composition, grasp_loop
from graspsense_sim_gripper.compiled.jit import COMPILING, OPTIONS, compile_part, generating
from graspsense_sim_gripper.loop import Buffers, Ending, GraspParams, LoopEnd, SimulationState, ending
from graspsense_sim_gripper.nested import Stored, TupleType
from graspsense_sim_gripper.problem import ControllerStep


def _grasp_unbound(params: GraspParams, progress: SimulationState, buffers: Buffers) -> SimulationState:
    raise TypeError("no loop is bound: use CompiledLoops")


def _store_unbound(array: Any, values: Any) -> None:
    raise TypeError("only compiled code stores numbers: use CompiledLoops")


grasp: Callable[[GraspParams, SimulationState, Buffers], SimulationState] = _grasp_unbound
store_numbers: Callable[[Any, Any], None] = _store_unbound


def stored_grasp(params: GraspParams, progress: SimulationState, buffers: Buffers, numbers: Any) -> Ending:
    """Run `grasp`, write the numbers of the state at its end to `numbers`, and return those that all callers read."""
    state = grasp(params, progress, buffers)
    store_numbers(numbers, state)
    return ending(state)


class _Types(NamedTuple):
    """The types of the state of a grasp."""

    state: TupleType
    plant: TupleType
    before_plant: int
    """Number of numbers of the state before those of the plant."""


class CompiledLoop:
    """The compiled loop of a composition for a controller. Its first grasp decides which numbers are integers."""

    def __init__(self, composition: Composition, compiled: Callable[..., Ending]) -> None:
        """Take the function that `compile_function` returned; its first call makes machine code."""
        self._composition, self._compiled = composition, compiled
        self._machine_code: Callable[..., Ending] | None = None
        self._types: _Types | None = None

    def run(self, params: GraspParams, progress: SimulationState, buffers: Buffers) -> LoopEnd:
        """Run the grasp from a state to its end, as `loop.grasp` does. Raises NotCompilable if numba refuses."""
        types = self._types or _types(progress)
        numbers = np.empty(types.state.count)
        if self._machine_code is not None:
            end = self._machine_code(params, progress, buffers, numbers)
        else:
            with generating(slp_vectorize=self._composition.shape is not None):
                end = self._compiled(params, progress, buffers, numbers)
            self._types, self._machine_code = types, entry_point(self._compiled)
        plant = numbers[types.before_plant : types.before_plant + types.plant.count]
        return LoopEnd(end, Stored(types.state, numbers), Stored(types.plant, plant))

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

    def of(self, composition: Composition) -> CompiledLoop:
        """Return the loop of a composition. Raises NotCompilable."""
        if composition not in self._loops:
            self._loops[composition] = CompiledLoop(composition, _compiled(composition, self._step))
        return self._loops[composition]


def _types(state: SimulationState) -> _Types:
    return _Types(TupleType.of(state), TupleType.of(state.plant), TupleType.of(state.loop).count)


@lru_cache(maxsize=64)
def _compiled(composition: Composition, step: ControllerStep) -> Callable[..., Ending]:
    """Return `stored_grasp` of a composition for a controller with this step, compiled. Raises NotCompilable."""
    try:
        from graspsense_sim_gripper.compiled.nested_numbers import store_numbers
    except ImportError as error:
        raise NotCompilable(f'numba is not installed: pip install "{OPTIONS.install}"') from error
    parts = {"grasp": grasp_loop(composition, step, interpreted=False), "store_numbers": store_numbers}
    with COMPILING:
        return compile_part(bind(stored_grasp, **parts))
